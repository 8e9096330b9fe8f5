#pragma once

#include <string>

#include <smartmill_msgs/FleetState.h>

#include "node/fleet_pusher.h"

namespace smartmill::loadmeter {

/// Message without its header. @param url of the server
smartmill_msgs::FleetState toMsg(const FleetPusher::State& state, const std::string& url);

}  // namespace smartmill::loadmeter
