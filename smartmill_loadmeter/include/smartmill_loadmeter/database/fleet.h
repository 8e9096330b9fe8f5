#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// Server of a fleet: a PostgreSQL database "postgresql://USER@HOST/NAME" with the records of a shop's
/// machines. Records are only added; each is identified by its content, and a login sees only the records of
/// its shop (row-level security). Cutting does not depend on the server.

/// Whether a name is the address of a fleet's server, not that of a file.
bool isServerUrl(const std::string& name);

/// Whether this build supports a server (./setup --with-fleet).
bool fleetSupported();

/// Address without its password.
std::string withoutPassword(const std::string& url);

/// Version of the server's tables that this program reads and writes; migrateFleet() updates older ones.
constexpr int FLEET_SCHEMA = 5;

/// Result of a transfer.
struct FleetTransfer {
  std::size_t offered = 0;  ///< records sent or received
  std::size_t fresh = 0;    ///< of these, new ones
};

using FleetProgress = std::function<void(const FleetTransfer&)>;

/// Sends the records that this server has not acknowledged, oldest first, one batch a transaction.
/// Acknowledged batches are noted in the file, so that an interrupted push continues and a repeated one adds
/// nothing.
/// @param all sends all records again (after a server was restored from an older copy).
/// @throws Error in one line; acknowledged batches remain.
FleetTransfer push(CoefficientDatabase& local, const std::string& url, const FleetProgress& progress = {},
                   bool all = false);

/// Fetches the records of the login's shop that the file does not have, one batch a transaction. @throws
/// Error as above.
FleetTransfer pull(CoefficientDatabase& local, const std::string& url, const FleetProgress& progress = {});

/// Opens a connection; each call of the result makes one round trip ("SELECT 1"), the lower bound of the time
/// of a query.
std::function<void()> roundTripTimer(const std::string& url);

/// Creates the tables, or updates those of an older version to `schema` without loss. Requires the owner's
/// login. @return the version found, 0: none.
int migrateFleet(const std::string& url, int schema = FLEET_SCHEMA);

/// Machine and its login.
struct FleetMember {
  std::string name;         ///< of the machine
  std::string login, shop;  ///< login at the server; machines of one shop read each other's records
  std::size_t records = 0;  ///< sent by this machine
  double silent = CoefficientRecord::UNKNOWN;  ///< [s] since its last push; NaN: never
  std::size_t behind = 0;                      ///< records not sent at that time
};

/// Creates a machine's login. Requires the owner's login. @param password empty: unchanged. @throws Error
/// when the machine has another login or shop.
void enrol(const std::string& url, const FleetMember& member, const std::string& password);

/// Machines visible to the login, by name.
std::vector<FleetMember> fleetMembers(const std::string& url);

}  // namespace smartmill::loadmeter
