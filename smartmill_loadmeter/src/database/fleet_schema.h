#pragma once

#include <string>

#include "fleet_connection.h"

namespace smartmill::loadmeter {

/// Holds the version of the server's tables against FLEET_SCHEMA. @return the fleet's identity.
/// @throws Error when there are none, or of another version, with what to do.
std::string checkFleet(FleetConnection& connection);

}  // namespace smartmill::loadmeter
