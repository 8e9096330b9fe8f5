#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "record_store.h"

struct sqlite3;

namespace smartmill::loadmeter {

/// Records in an SQLite file or in memory, and the state of their synchronisation with fleets. The C
/// interface is used directly: NULL as NaN and errors as "FILE: reason" need a wrapper of the same size with
/// SQLiteCpp, which copies a shared pointer for each of the 50 columns of a record.
class SqliteStore : public RecordStore {
 public:
  /// @param file empty: in memory. @throws Error when the file is not such a database or cannot be opened.
  explicit SqliteStore(const std::string& file);
  ~SqliteStore() override;
  SqliteStore(const SqliteStore&) = delete;
  SqliteStore& operator=(const SqliteStore&) = delete;

  std::size_t add(const RecordKind& kind, const std::vector<Row>& rows) override;
  std::vector<Row> rows(const RecordKind& kind) override;
  std::optional<CoefficientRecord> newest(const std::string& tool, const std::string& material) override;
  std::vector<CoefficientRecord> records(const std::string& tool, const std::string& material) override;
  std::vector<CoefficientRecord> near(const std::string& tool, const CoefficientQuery& query) override;
  std::vector<std::pair<std::string, std::string>> pairs() override;
  std::size_t size() override;

  /// @{ As in CoefficientDatabase.
  CoefficientDatabase::Batch unsent(const std::string& fleet, const RecordKind& kind,
                                    std::size_t limit) const;
  std::size_t unsentCount(const std::string& fleet, const RecordKind& kind) const;
  void markSent(const std::string& fleet, const RecordKind& kind, std::int64_t last);
  std::string lastFleet() const;
  std::size_t addFrom(const std::string& fleet, const RecordKind& kind, const std::vector<Row>& rows);
  std::vector<std::string> identities(const RecordKind& kind) const;
  /// @}

 private:
  void execute(const std::string& sql) const;
  int version() const;
  void prepare() const;
  void switchToWriteAheadLog() const;
  void makeFirst() const;
  void makeSecond() const;
  template <typename Work>
  void transaction(const Work& work) const;
  std::size_t insert(const RecordKind& kind, const std::vector<Row>& rows) const;
  std::int64_t sentUpTo(const std::string& fleet, const RecordKind& kind) const;

  std::string file_;
  sqlite3* db_ = nullptr;
};

}  // namespace smartmill::loadmeter
