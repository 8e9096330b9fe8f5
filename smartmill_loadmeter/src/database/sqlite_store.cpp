#include "sqlite_store.h"

#include <SQLiteCpp/Column.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>

#include <algorithm>
#include <cmath>

#include "sqlite_tables.h"

namespace smartmill::loadmeter {

namespace {

constexpr int BUSY_TIMEOUT = 30000;  // [ms] longest wait for other writers

/// Statement with NaN as NULL.
class Statement : public SQLite::Statement {
 public:
  using SQLite::Statement::Statement;

  void bindNumber(int at, double number) {
    if (std::isfinite(number)) return bind(at, number);
    bind(at);
  }
  std::string word(int column) const { return getColumn(column).getString(); }
  double number(int column) const {
    const SQLite::Column value = getColumn(column);
    return value.isNull() ? CoefficientRecord::UNKNOWN : value.getDouble();
  }
  std::int64_t integer(int column) const { return getColumn(column).getInt64(); }
};

CoefficientRecord recordOf(const Statement& row) {
  CoefficientRecord record;
  int column = 0;
  for (const TextField& f : textFields()) f.at(record) = row.word(column++);
  for (const NumberField& f : numberFields()) f.set(record, f.index, row.number(column++));
  return record;
}

// From the columns of RecordKind::columns().
Row rowOf(const RecordKind& kind, const Statement& s) {
  Row row;
  int column = 0;
  row.identity = s.word(column++);
  if (kind.by_speed) row.speed_bucket = s.integer(column++);
  for (std::size_t i = 0; i < kind.words.size(); ++i) row.words.push_back(s.word(column++));
  for (std::size_t i = 0; i < kind.numbers.size(); ++i) row.numbers.push_back(s.number(column++));
  return row;
}

std::string whereOf(const std::string& tool, const std::string& material) {
  std::string sql;
  if (!material.empty()) sql += " WHERE material = ?1";
  if (!tool.empty()) sql += std::string(sql.empty() ? " WHERE" : " AND") + " tool = ?2";
  return sql;
}
void bindPair(Statement& s, const std::string& tool, const std::string& material) {
  if (!material.empty()) s.bind(1, material);
  if (!tool.empty()) s.bind(2, tool);
}

}  // namespace

SqliteStore::SqliteStore(const std::string& file)
    : db_(file, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE | SQLite::OPEN_FULLMUTEX, BUSY_TIMEOUT) {
  prepareTables(db_);
}

void SqliteStore::check() {
  std::string found = db_.execAndGet("PRAGMA quick_check(1)").getString();
  std::replace(found.begin(), found.end(), '\n', ' ');
  if (found != "ok") throw SQLite::Exception("damaged: " + found);
}

std::size_t SqliteStore::add(const RecordKind& kind, const std::vector<Row>& rows) {
  SQLite::Transaction transaction(db_, SQLite::TransactionBehavior::IMMEDIATE);
  const std::size_t added = insert(kind, rows);
  transaction.commit();
  return added;
}

std::size_t SqliteStore::insert(const RecordKind& kind, const std::vector<Row>& rows) const {
  std::size_t added = 0;
  std::string marks = "?1";
  const std::size_t count = kind.words.size() + kind.numbers.size() + (kind.by_speed ? 1 : 0);
  for (std::size_t i = 0; i < count; ++i) marks += ", ?" + std::to_string(i + 2);
  Statement insert(
      db_, "INSERT OR IGNORE INTO " + kind.table + " (" + kind.columns() + ") VALUES (" + marks + ")");
  for (const Row& row : rows) {
    int at = 1;
    insert.bind(at++, row.identity);
    if (kind.by_speed) insert.bind(at++, row.speed_bucket);
    for (const std::string& word : row.words) insert.bind(at++, word);
    for (const double number : row.numbers) insert.bindNumber(at++, number);
    added += static_cast<std::size_t>(insert.exec());
    insert.reset();
  }
  return added;
}

std::vector<Row> SqliteStore::rows(const RecordKind& kind) {
  Statement s(db_, "SELECT " + kind.columns() + " FROM " + kind.table + " ORDER BY stamp, id");
  std::vector<Row> found;
  while (s.executeStep()) found.push_back(rowOf(kind, s));
  return found;
}

std::optional<CoefficientRecord> SqliteStore::newest(const std::string& tool, const std::string& material) {
  Statement s(db_, "SELECT " + columns() + " FROM coefficients" + whereOf(tool, material) +
                       " ORDER BY stamp DESC, id DESC LIMIT 1");
  bindPair(s, tool, material);
  if (!s.executeStep()) return std::nullopt;
  return recordOf(s);
}

std::vector<CoefficientRecord> SqliteStore::records(const std::string& tool, const std::string& material) {
  Statement s(db_,
              "SELECT " + columns() + " FROM coefficients" + whereOf(tool, material) + " ORDER BY stamp, id");
  bindPair(s, tool, material);
  std::vector<CoefficientRecord> found;
  while (s.executeStep()) found.push_back(recordOf(s));
  return found;
}

std::vector<CoefficientRecord> SqliteStore::near(const std::string& tool, const CoefficientQuery& query) {
  std::vector<CoefficientRecord> found;
  const std::string select = "SELECT " + columns() + " FROM coefficients" + whereOf(tool, query.material);
  const std::string newest = " ORDER BY stamp DESC LIMIT " + std::to_string(NEWEST);
  const auto collect = [&](Statement& s) {
    while (s.executeStep()) found.push_back(recordOf(s));
    s.reset();
  };
  if (query.cutting_speed > 0.0) {
    const char* also = select.find(" WHERE") == std::string::npos ? " WHERE" : " AND";
    Statement s(db_, select + also + " speed_bucket = ?3" + newest);
    std::vector<int> buckets{NO_SPEED};
    for (int b = -BUCKETS; b <= BUCKETS; ++b) buckets.push_back(bucketOf(query.cutting_speed) + b);
    for (const int bucket : buckets) {
      bindPair(s, tool, query.material);
      s.bind(3, std::int64_t{bucket});
      collect(s);
    }
  }
  if (found.empty()) {
    Statement any(db_, select + newest);
    bindPair(any, tool, query.material);
    collect(any);
  }
  return found;
}

std::vector<std::pair<std::string, std::string>> SqliteStore::pairs() {
  Statement s(db_, "SELECT DISTINCT tool, material FROM coefficients ORDER BY 1, 2");
  std::vector<std::pair<std::string, std::string>> found;
  while (s.executeStep()) found.emplace_back(s.word(0), s.word(1));
  return found;
}

std::size_t SqliteStore::size() {
  return static_cast<std::size_t>(db_.execAndGet("SELECT count(*) FROM coefficients").getInt64());
}

// The numbers of records follow the order of insertion, because a file has one writer at a time.
std::int64_t SqliteStore::sentUpTo(const std::string& to, const RecordKind& kind) const {
  Statement s(db_, "SELECT last FROM handed WHERE fleet = ?1 AND kind = ?2");
  s.bind(1, to);
  s.bind(2, kind.table);
  return s.executeStep() ? s.integer(0) : 0;
}

FleetSynchronisation::Batch SqliteStore::unsent(const std::string& fleet, const RecordKind& kind,
                                                std::size_t limit) const {
  FleetSynchronisation::Batch batch;
  Statement s(db_,
              "SELECT " + kind.columns() + ", id FROM " + kind.table + " WHERE id > ?1 ORDER BY id LIMIT ?2");
  s.bind(1, sentUpTo(fleet, kind));
  s.bind(2, static_cast<std::int64_t>(limit));
  const int id = static_cast<int>(kind.words.size() + kind.numbers.size()) + (kind.by_speed ? 2 : 1);
  while (s.executeStep()) {
    batch.rows.push_back(rowOf(kind, s));
    batch.last = s.integer(id);
  }
  return batch;
}

std::size_t SqliteStore::unsentCount(const std::string& fleet, const RecordKind& kind) const {
  Statement s(db_, "SELECT count(*) FROM " + kind.table + " WHERE id > ?1");
  s.bind(1, sentUpTo(fleet, kind));
  return s.executeStep() ? static_cast<std::size_t>(s.integer(0)) : 0;
}

void SqliteStore::markSent(const std::string& fleet, const RecordKind& kind, std::int64_t last) {
  Statement s(db_,
              "INSERT OR REPLACE INTO handed (fleet, kind, last, at) VALUES (?1, ?2, ?3, julianday('now'))");
  s.bind(1, fleet);
  s.bind(2, kind.table);
  s.bind(3, last);
  s.executeStep();
}

std::string SqliteStore::lastFleet() const {
  Statement s(db_, "SELECT fleet FROM handed ORDER BY at DESC LIMIT 1");
  return s.executeStep() ? s.word(0) : "";
}

std::size_t SqliteStore::addFrom(const std::string& fleet, const RecordKind& kind,
                                 const std::vector<Row>& rows) {
  SQLite::Transaction transaction(db_, SQLite::TransactionBehavior::IMMEDIATE);
  const bool nothing_waits = unsentCount(fleet, kind) == 0;
  const std::size_t added = insert(kind, rows);
  if (nothing_waits && added > 0)
    markSent(fleet, kind, db_.execAndGet("SELECT max(id) FROM " + kind.table).getInt64());
  transaction.commit();
  return added;
}

std::vector<std::string> SqliteStore::identities(const RecordKind& kind) const {
  Statement s(db_, "SELECT identity FROM " + kind.table);
  std::vector<std::string> found;
  while (s.executeStep()) found.push_back(s.word(0));
  return found;
}

}  // namespace smartmill::loadmeter
