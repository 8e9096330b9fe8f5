#pragma once

#include <string>

#include "fleet_connection.h"

namespace smartmill::loadmeter {

/// Checks the version of the server's tables against FLEET_SCHEMA. @return the fleet's identity.
/// @throws Error without tables, or with another version, and what to do.
std::string checkFleet(FleetConnection& connection);

}  // namespace smartmill::loadmeter
