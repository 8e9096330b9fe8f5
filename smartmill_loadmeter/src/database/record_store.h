#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "record_fields.h"
#include "smartmill_loadmeter/database/database.h"

namespace smartmill::loadmeter {

/// Storage of records: a file (errors are SQLite::Exception) or a fleet's server (Error "URL: reason").
class RecordStore {
 public:
  virtual ~RecordStore() = default;

  /// One transaction. @return number of new records.
  virtual std::size_t add(const RecordKind& kind, const std::vector<Row>& rows) = 0;
  virtual std::vector<Row> rows(const RecordKind& kind) = 0;  ///< all, oldest first
  /// @{ Coefficients. Empty text matches any.
  virtual std::optional<CoefficientRecord> newest(const std::string& tool, const std::string& material) = 0;
  virtual std::vector<CoefficientRecord> records(const std::string& tool, const std::string& material) = 0;
  /// Newest records of a pair near the cutting speed; of any speed if there is none.
  virtual std::vector<CoefficientRecord> near(const std::string& tool, const CoefficientQuery& query) = 0;
  virtual std::vector<std::pair<std::string, std::string>> pairs() = 0;  ///< tool, material
  virtual std::size_t size() = 0;
  /// @}
};

}  // namespace smartmill::loadmeter
