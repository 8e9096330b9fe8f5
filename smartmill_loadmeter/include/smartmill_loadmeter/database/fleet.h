#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// A fleet's server keeps what the machines of a shop have identified: PostgreSQL,
/// "postgresql://USER@HOST/NAME". Records are only ever added, each is recognised by its content, and a login
/// sees its own shop's only (row-level security). The machine's file stays the machine's own: nothing here is
/// needed for cutting.

/// Whether a name is the address of a fleet's server and not that of a file.
bool isFleet(const std::string& name);

/// Whether this build can talk to one (./setup --with-fleet).
bool fleetSupported();

/// The address as it may be shown.
std::string withoutPassword(const std::string& url);

/// Version of the server's tables that this program writes and reads; older servers: migrateFleet().
constexpr int FLEET_SCHEMA = 3;

/// What a transfer did.
struct FleetTransfer {
  std::size_t offered = 0;  ///< records that were sent, or that came
  std::size_t fresh = 0;    ///< of them were not there yet
};

using FleetProgress = std::function<void(const FleetTransfer&)>;

/// Sends what the file has and this server has not acknowledged yet, oldest first, a batch a transaction:
/// what was acknowledged is noted in the file, so that a push goes on where another one was cut off. One that
/// is repeated adds nothing. @param all offers everything anew (after a server was restored from an older
/// copy).
/// @throws Error in one line; what was acknowledged before stays.
FleetTransfer push(CoefficientDatabase& local, const std::string& url, const FleetProgress& progress = {},
                   bool all = false);

/// Takes over what the login's shop has and the file has not, a batch a transaction. @throws Error as above.
FleetTransfer pull(CoefficientDatabase& local, const std::string& url, const FleetProgress& progress = {});

/// On a connection of its own: each call asks the server for nothing ("SELECT 1"), there and back, which is
/// what any look-up takes at least.
std::function<void()> fleetEcho(const std::string& url);

/// Makes the tables in an empty database, or brings those of an older version to `schema`; nothing is lost.
/// To be done by the database's owner. @return the version found, 0: none.
int migrateFleet(const std::string& url, int schema = FLEET_SCHEMA);

/// One machine and its login.
struct FleetMember {
  std::string name;         ///< of the machine
  std::string login, shop;  ///< login of the server; who shares a shop reads each other's records
  std::size_t records = 0;  ///< that it brought
  double silent = CoefficientRecord::UNKNOWN;  ///< [s] since its last push; NaN: none yet
  std::size_t behind = 0;                      ///< records that it had not sent then
};

/// Gives a machine its login, made when there is none. To be done by the database's owner. @param password
/// empty: left as it is. @throws Error when the machine has another login or shop.
void enrol(const std::string& url, const FleetMember& member, const std::string& password);

/// Machines that the login may see, by name.
std::vector<FleetMember> fleetMembers(const std::string& url);

}  // namespace smartmill::loadmeter
