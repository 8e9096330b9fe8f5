#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_loadmeter/database/fleet.h"

namespace smartmill::loadmeter {

/// Connection to a fleet's server. Every function throws Error "URL: reason" in one line.
class FleetServer {
 public:
  virtual ~FleetServer() = default;

  virtual std::string identity() = 0;  ///< of this fleet, created with its tables
  virtual void echo() = 0;             ///< one round trip
  /// One transaction. @return number of new records.
  virtual std::size_t add(const RecordKind& kind, const std::vector<Row>& rows) = 0;
  virtual std::vector<Row> rows(const RecordKind& kind) = 0;  ///< all, oldest first
  /// Stores the result of a push and the number of records that the machine has not sent.
  virtual void storePush(const FleetTransfer& done, std::size_t behind) = 0;
  virtual std::optional<CoefficientRecord> newest(const std::string& tool, const std::string& material) = 0;
  virtual std::vector<CoefficientRecord> records(const std::string& tool, const std::string& material) = 0;
  virtual std::vector<CoefficientRecord> near(const std::string& tool, const CoefficientQuery& query) = 0;
  virtual std::vector<std::pair<std::string, std::string>> pairs() = 0;  ///< tool, material
  virtual std::size_t size() = 0;
  /// Passes the records without these identities in batches, all of one snapshot.
  virtual void missing(const RecordKind& kind, const std::vector<std::string>& identities,
                       const std::function<void(const std::vector<Row>&)>& batch) = 0;
  virtual std::vector<FleetMember> members() = 0;
};

/// @throws Error without the server, login or tables of this version, or when the build has no libpq.
std::unique_ptr<FleetServer> connectFleet(const std::string& url);

}  // namespace smartmill::loadmeter
