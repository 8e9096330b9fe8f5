#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "smartmill_loadmeter/database/fleet.h"

namespace smartmill::loadmeter {

/// One connection to a fleet's server. Every function throws Error "URL: what" in one line.
class FleetServer {
 public:
  virtual ~FleetServer() = default;

  virtual std::string identity() = 0;  ///< of this fleet, made with its tables
  virtual void echo() = 0;             ///< one question that asks for nothing, there and back
  /// One transaction: all or none. @return how many were new.
  virtual std::size_t add(const RecordKind& kind, const std::vector<Row>& rows) = 0;
  virtual std::vector<Row> rows(const RecordKind& kind) = 0;  ///< all, oldest first
  /// Notes beside the machine that it pushed just now, and how many records it still has.
  virtual void notePush(const FleetTransfer& done, std::size_t behind) = 0;
  virtual std::optional<CoefficientRecord> newest(const std::string& tool, const std::string& material) = 0;
  virtual std::vector<CoefficientRecord> records(const std::string& tool, const std::string& material) = 0;
  virtual std::vector<CoefficientRecord> near(const std::string& tool, const CoefficientQuery& query) = 0;
  virtual std::vector<std::pair<std::string, std::string>> pairs() = 0;  ///< tool, material
  virtual std::size_t size() = 0;
  /// Records that are not among these, in batches, all of one moment.
  virtual void missing(const RecordKind& kind, const std::vector<std::string>& identities,
                       const std::function<void(const std::vector<Row>&)>& batch) = 0;
  virtual std::vector<FleetMember> members() = 0;
};

/// @throws Error when there is no such server, login or version of the tables, or no libpq in this build.
std::unique_ptr<FleetServer> connectFleet(const std::string& url);

}  // namespace smartmill::loadmeter
