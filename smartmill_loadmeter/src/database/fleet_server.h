#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "record_store.h"
#include "smartmill_loadmeter/database/fleet.h"

namespace smartmill::loadmeter {

constexpr std::size_t FLEET_BATCH = 2000;  ///< records of a transaction or fetch: about 50 ms, 2 MB

/// Connection to a fleet's server.
class FleetServer : public RecordStore {
 public:
  virtual std::string identity() = 0;  ///< of this fleet, created with its tables
  virtual void echo() = 0;             ///< one round trip
  /// Stores the result of a push and the number of records that the machine has not sent.
  virtual void storePush(const FleetTransfer& done, std::size_t behind) = 0;
  /// Passes the records without these identities in batches, all of one snapshot.
  virtual void missing(const RecordKind& kind, const std::vector<std::string>& identities,
                       const std::function<void(const std::vector<Row>&)>& batch) = 0;
  virtual std::vector<FleetMember> members() = 0;
};

/// @throws Error without the server, login or tables of this version, or when the build has no libpq.
std::unique_ptr<FleetServer> connectFleet(const std::string& url);

}  // namespace smartmill::loadmeter
