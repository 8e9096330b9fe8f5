#pragma once

#include <string>

#include <ros/node_handle.h>

#include "node/commands.h"
#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// Requests of the page that are answered by services of other nodes. None changes the machine.
/// @throws Error on an invalid query.
ApiResponse queryWhatIf(ros::NodeHandle& nh, const ApiRequest& request);
/// Replay of a recording: pause, speed and position.
ApiResponse controlReplay(ros::NodeHandle& nh, const ApiRequest& request);
ApiResponse queryCoefficients(ros::NodeHandle& nh, const ApiRequest& request);

/// Teeth, speeds and tries of sound_node; requires no token, moves nothing, is logged.
ApiResponse setSoundCut(ros::NodeHandle& nh, const ApiRequest& request, PanelLog& log);

/// The newest report.json below a folder, with its folder's name.
ApiResponse newestReport(const std::string& folder);

}  // namespace smartmill::panel
