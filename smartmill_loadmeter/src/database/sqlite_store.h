#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>

#include "record_store.h"
#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

/// @throws Error "FILE: reason" in place of the exceptions of SQLiteCpp.
template <typename Work>
auto naming(const std::string& file, const Work& work) {
  try {
    return work();
  } catch (const SQLite::Exception& error) {
    throw Error(file + ": " + error.what());
  }
}

/// Records in an SQLite file or in memory, and the state of their synchronisation with fleets.
class SqliteStore : public RecordStore {
 public:
  /// @throws SQLite::Exception when the file is not such a database or cannot be opened.
  explicit SqliteStore(const std::string& file);

  std::size_t add(const RecordKind& kind, const std::vector<Row>& rows) override;
  std::vector<Row> rows(const RecordKind& kind) override;
  std::optional<CoefficientRecord> newest(const std::string& tool, const std::string& material) override;
  std::vector<CoefficientRecord> records(const std::string& tool, const std::string& material) override;
  std::vector<CoefficientRecord> near(const std::string& tool, const CoefficientQuery& query) override;
  std::vector<std::pair<std::string, std::string>> pairs() override;
  std::size_t size() override;

  /// @throws SQLite::Exception when the content is damaged.
  void check();

  /// @{ As in FleetSynchronisation.
  FleetSynchronisation::Batch unsent(const std::string& fleet, const RecordKind& kind,
                                     std::size_t limit) const;
  std::size_t unsentCount(const std::string& fleet, const RecordKind& kind) const;
  void markSent(const std::string& fleet, const RecordKind& kind, std::int64_t last);
  std::string lastFleet() const;
  std::size_t addFrom(const std::string& fleet, const RecordKind& kind, const std::vector<Row>& rows);
  std::vector<std::string> identities(const RecordKind& kind) const;
  /// @}

 private:
  std::size_t insert(const RecordKind& kind, const std::vector<Row>& rows) const;
  std::int64_t sentUpTo(const std::string& fleet, const RecordKind& kind) const;

  SQLite::Database db_;
};

}  // namespace smartmill::loadmeter
