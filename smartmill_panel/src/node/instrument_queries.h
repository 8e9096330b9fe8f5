#pragma once

#include <ros/node_handle.h>

#include "node/commands.h"
#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// Authorised requests of the first connection of instruments, answered by setup_node of smartmill_daq, which
/// cannot move the machine. What writes a file is logged.
ApiResponse tryInstrument(ros::NodeHandle& nh, const ApiRequest& request, PanelLog& log);
ApiResponse calibrateChannel(ros::NodeHandle& nh, const ApiRequest& request, PanelLog& log);

}  // namespace smartmill::panel
