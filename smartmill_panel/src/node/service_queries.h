#pragma once

#include <string>

#include <ros/node_handle.h>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// Requests of the page that are answered by services of other nodes. None changes the machine.
/// @throws Error on an invalid query.
ApiResponse queryWhatIf(ros::NodeHandle& nh, const ApiRequest& request);
/// Replay of a recording: pause, speed and position.
ApiResponse controlReplay(ros::NodeHandle& nh, const ApiRequest& request);
ApiResponse queryCoefficients(ros::NodeHandle& nh, const ApiRequest& request);

/// The newest report.json below a folder, with its folder's name.
ApiResponse newestReport(const std::string& folder);

}  // namespace smartmill::panel
