#pragma once

#include <string>

#include <ros/node_handle.h>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// What the page asks the other nodes through this one. Nothing here changes the machine.
/// @throws Error on a bad query.
Answer askWhatIf(ros::NodeHandle& nh, const Question& question);
/// Of a recording that is played: pause, speed and place.
Answer controlReplay(ros::NodeHandle& nh, const Question& question);
Answer askCoefficients(ros::NodeHandle& nh, const Question& question);

/// The newest report.json below a folder, with its folder's name.
Answer newestReport(const std::string& folder);

}  // namespace smartmill::panel
