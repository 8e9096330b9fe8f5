#pragma once

#include <string>

#include <smartmill_msgs/FleetState.h>

#include "node/fleet_pusher.h"

namespace smartmill::loadmeter {

/// Topic that tells what a machine last heard of its fleet.
constexpr const char* FLEET_STATE = "loadmeter/fleet";

/// Its header is left to who sends it. @param url of the server
smartmill_msgs::FleetState toMsg(const FleetPusher::State& state, const std::string& url);

}  // namespace smartmill::loadmeter
