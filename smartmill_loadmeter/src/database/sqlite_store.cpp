#include "sqlite_store.h"

#include <sqlite3.h>

#include <cmath>

#include "smartmill_core/error.h"

namespace smartmill::loadmeter {

namespace {

// 1: coefficients. 2: adds improvements and health, and the state of synchronisation of each kind.
constexpr int SCHEMA = 2;
constexpr int BUSY_TIMEOUT = 30000;  // [ms] longest wait for other writers

class Statement {
 public:
  Statement(sqlite3* db, const std::string& file, const std::string& sql) : db_(db), file_(file) {
    if (sqlite3_prepare_v2(db, sql.c_str(), -1, &statement_, nullptr) != SQLITE_OK) fail();
  }
  ~Statement() { sqlite3_finalize(statement_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  void bind(int at, const std::string& word) {
    if (sqlite3_bind_text(statement_, at, word.c_str(), -1, SQLITE_TRANSIENT) != SQLITE_OK) fail();
  }
  void bind(int at, double number) {
    const int code = std::isfinite(number) ? sqlite3_bind_double(statement_, at, number)
                                           : sqlite3_bind_null(statement_, at);
    if (code != SQLITE_OK) fail();
  }
  void bind(int at, std::int64_t number) {
    if (sqlite3_bind_int64(statement_, at, number) != SQLITE_OK) fail();
  }
  /// @return whether there is a row.
  bool step() {
    const int code = sqlite3_step(statement_);
    if (code != SQLITE_ROW && code != SQLITE_DONE) fail();
    return code == SQLITE_ROW;
  }
  void reset() { sqlite3_reset(statement_); }
  std::string word(int column) const {
    const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement_, column));
    return text ? text : "";
  }
  double number(int column) const {
    if (sqlite3_column_type(statement_, column) == SQLITE_NULL) return CoefficientRecord::UNKNOWN;
    return sqlite3_column_double(statement_, column);
  }
  int integer(int column) const { return sqlite3_column_int(statement_, column); }
  std::int64_t whole(int column) const { return sqlite3_column_int64(statement_, column); }

 private:
  [[noreturn]] void fail() const { throw Error(file_ + ": " + sqlite3_errmsg(db_)); }
  sqlite3* db_;
  const std::string& file_;
  sqlite3_stmt* statement_ = nullptr;
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
  if (kind.by_speed) row.speed_bucket = s.whole(column++);
  for (std::size_t i = 0; i < kind.words.size(); ++i) row.words.push_back(s.word(column++));
  for (std::size_t i = 0; i < kind.numbers.size(); ++i) row.numbers.push_back(s.number(column++));
  return row;
}

std::string createOf(const RecordKind& kind) {
  std::string sql = "CREATE TABLE " + kind.table + " (id INTEGER PRIMARY KEY, identity TEXT NOT NULL UNIQUE";
  if (kind.by_speed) sql += ", speed_bucket INTEGER NOT NULL";
  for (const std::string& name : kind.words) sql += ", " + name + " TEXT NOT NULL";
  for (const std::string& name : kind.numbers) sql += ", " + name + " REAL";
  return sql + ")";
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

SqliteStore::SqliteStore(const std::string& file) : file_(file.empty() ? ":memory:" : file) {
  const int code = sqlite3_open_v2(
      file_.c_str(), &db_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX, nullptr);
  try {
    if (code != SQLITE_OK) throw Error(file_ + ": " + (db_ ? sqlite3_errmsg(db_) : "cannot be opened"));
    sqlite3_busy_timeout(db_, BUSY_TIMEOUT);
    prepare();
  } catch (...) {
    sqlite3_close(db_);
    throw;
  }
}

SqliteStore::~SqliteStore() {
  sqlite3_close(db_);
}

void SqliteStore::execute(const std::string& sql) const {
  char* message = nullptr;
  if (sqlite3_exec(db_, sql.c_str(), nullptr, nullptr, &message) == SQLITE_OK) return;
  const std::string what = message ? message : "failed";
  sqlite3_free(message);
  throw Error(file_ + ": " + what);
}

int SqliteStore::version() const {
  Statement s(db_, file_, "PRAGMA user_version");
  return s.step() ? s.integer(0) : 0;
}

template <typename Work>
void SqliteStore::transaction(const Work& work) const {
  execute("BEGIN IMMEDIATE");
  try {
    work();
    execute("COMMIT");
  } catch (...) {
    sqlite3_exec(db_, "ROLLBACK", nullptr, nullptr, nullptr);
    throw;
  }
}

void SqliteStore::switchToWriteAheadLog() const {
  // The journal mode is stored in the file, so that only one process switches it.
  Statement mode(db_, file_, "PRAGMA journal_mode");
  const bool is_wal = mode.step() && mode.word(0) == "wal";
  mode.reset();
  for (int tries = 0; !is_wal; ++tries) {
    try {
      execute("PRAGMA journal_mode=WAL");
      break;
    } catch (const Error&) {
      // SQLite does not wait for other processes when it switches the mode.
      if (tries == 200 || sqlite3_errcode(db_) != SQLITE_BUSY) throw;
      sqlite3_sleep(20);
    }
  }
}

void SqliteStore::prepare() const {
  switchToWriteAheadLog();
  execute("PRAGMA synchronous=FULL");
  if (version() < SCHEMA) {
    transaction([this] {
      // Another process may have done it meanwhile.
      if (version() == 0) makeFirst();
      if (version() == 1) makeSecond();
    });
  }
  if (version() != SCHEMA) {
    throw Error(file_ + ": schema " + std::to_string(version()) + ", expected at most " +
                std::to_string(SCHEMA));
  }
}

void SqliteStore::makeFirst() const {
  {
    Statement tables(db_, file_, "SELECT count(*) FROM sqlite_master");
    if (tables.step() && tables.integer(0) > 0) {
      throw Error(file_ + ": not a database of cutting coefficients");
    }
  }
  execute(createOf(coefficientKind()));
  execute("CREATE INDEX pair ON coefficients (material, tool, speed_bucket, stamp)");
  execute("CREATE INDEX material_speed ON coefficients (material, speed_bucket, stamp)");
  execute("CREATE INDEX newest ON coefficients (material, tool, stamp)");
  execute("CREATE INDEX newest_of_tool ON coefficients (tool, stamp)");
  execute("CREATE INDEX newest_of_material ON coefficients (material, stamp)");
  execute("CREATE INDEX newest_of_all ON coefficients (stamp)");
  execute("PRAGMA user_version=1");
}

// Some files of version 1 have the table `sent`, for coefficients only.
void SqliteStore::makeSecond() const {
  execute(createOf(improvementKind()));
  execute(createOf(healthKind()));
  execute(
      "CREATE TABLE handed (fleet TEXT, kind TEXT, last INTEGER, at REAL, PRIMARY KEY (fleet, kind));"
      "CREATE TABLE IF NOT EXISTS sent (fleet TEXT PRIMARY KEY, last INTEGER, at REAL);"
      "INSERT INTO handed SELECT fleet, 'coefficients', last, at FROM sent;"
      "DROP TABLE sent");
  execute("PRAGMA user_version=2");
}

std::size_t SqliteStore::add(const RecordKind& kind, const std::vector<Row>& rows) {
  std::size_t added = 0;
  transaction([&] { added = insert(kind, rows); });
  return added;
}

std::size_t SqliteStore::insert(const RecordKind& kind, const std::vector<Row>& rows) const {
  std::size_t added = 0;
  std::string marks = "?1";
  const std::size_t count = kind.words.size() + kind.numbers.size() + (kind.by_speed ? 1 : 0);
  for (std::size_t i = 0; i < count; ++i) marks += ", ?" + std::to_string(i + 2);
  Statement insert(
      db_, file_, "INSERT OR IGNORE INTO " + kind.table + " (" + kind.columns() + ") VALUES (" + marks + ")");
  for (const Row& row : rows) {
    int at = 1;
    insert.bind(at++, row.identity);
    if (kind.by_speed) insert.bind(at++, row.speed_bucket);
    for (const std::string& word : row.words) insert.bind(at++, word);
    for (const double number : row.numbers) insert.bind(at++, number);
    insert.step();
    added += static_cast<std::size_t>(sqlite3_changes(db_));
    insert.reset();
  }
  return added;
}

std::vector<Row> SqliteStore::rows(const RecordKind& kind) {
  Statement s(db_, file_, "SELECT " + kind.columns() + " FROM " + kind.table + " ORDER BY stamp, id");
  std::vector<Row> found;
  while (s.step()) found.push_back(rowOf(kind, s));
  return found;
}

std::optional<CoefficientRecord> SqliteStore::newest(const std::string& tool, const std::string& material) {
  Statement s(db_, file_,
              "SELECT " + columns() + " FROM coefficients" + whereOf(tool, material) +
                  " ORDER BY stamp DESC, id DESC LIMIT 1");
  bindPair(s, tool, material);
  if (!s.step()) return std::nullopt;
  return recordOf(s);
}

std::vector<CoefficientRecord> SqliteStore::records(const std::string& tool, const std::string& material) {
  Statement s(db_, file_,
              "SELECT " + columns() + " FROM coefficients" + whereOf(tool, material) + " ORDER BY stamp, id");
  bindPair(s, tool, material);
  std::vector<CoefficientRecord> found;
  while (s.step()) found.push_back(recordOf(s));
  return found;
}

std::vector<CoefficientRecord> SqliteStore::near(const std::string& tool, const CoefficientQuery& query) {
  std::vector<CoefficientRecord> found;
  const std::string select = "SELECT " + columns() + " FROM coefficients" + whereOf(tool, query.material);
  const std::string newest = " ORDER BY stamp DESC LIMIT " + std::to_string(NEWEST);
  const auto collect = [&](Statement& s) {
    while (s.step()) found.push_back(recordOf(s));
    s.reset();
  };
  if (query.cutting_speed > 0.0) {
    const char* also = select.find(" WHERE") == std::string::npos ? " WHERE" : " AND";
    Statement s(db_, file_, select + also + " speed_bucket = ?3" + newest);
    std::vector<int> buckets{NO_SPEED};
    for (int b = -BUCKETS; b <= BUCKETS; ++b) buckets.push_back(bucketOf(query.cutting_speed) + b);
    for (const int bucket : buckets) {
      bindPair(s, tool, query.material);
      s.bind(3, std::int64_t{bucket});
      collect(s);
    }
  }
  if (found.empty()) {
    Statement any(db_, file_, select + newest);
    bindPair(any, tool, query.material);
    collect(any);
  }
  return found;
}

std::vector<std::pair<std::string, std::string>> SqliteStore::pairs() {
  Statement s(db_, file_, "SELECT DISTINCT tool, material FROM coefficients ORDER BY 1, 2");
  std::vector<std::pair<std::string, std::string>> found;
  while (s.step()) found.emplace_back(s.word(0), s.word(1));
  return found;
}

std::size_t SqliteStore::size() {
  Statement s(db_, file_, "SELECT count(*) FROM coefficients");
  return s.step() ? static_cast<std::size_t>(s.whole(0)) : 0;
}

// The numbers of records follow the order of insertion, because a file has one writer at a time.
std::int64_t SqliteStore::sentUpTo(const std::string& to, const RecordKind& kind) const {
  Statement s(db_, file_, "SELECT last FROM handed WHERE fleet = ?1 AND kind = ?2");
  s.bind(1, to);
  s.bind(2, kind.table);
  return s.step() ? s.whole(0) : 0;
}

CoefficientDatabase::Batch SqliteStore::unsent(const std::string& fleet, const RecordKind& kind,
                                               std::size_t limit) const {
  CoefficientDatabase::Batch batch;
  Statement s(db_, file_,
              "SELECT " + kind.columns() + ", id FROM " + kind.table + " WHERE id > ?1 ORDER BY id LIMIT ?2");
  s.bind(1, sentUpTo(fleet, kind));
  s.bind(2, static_cast<std::int64_t>(limit));
  const int id = static_cast<int>(kind.words.size() + kind.numbers.size()) + (kind.by_speed ? 2 : 1);
  while (s.step()) {
    batch.rows.push_back(rowOf(kind, s));
    batch.last = s.whole(id);
  }
  return batch;
}

std::size_t SqliteStore::unsentCount(const std::string& fleet, const RecordKind& kind) const {
  Statement s(db_, file_, "SELECT count(*) FROM " + kind.table + " WHERE id > ?1");
  s.bind(1, sentUpTo(fleet, kind));
  return s.step() ? static_cast<std::size_t>(s.whole(0)) : 0;
}

void SqliteStore::markSent(const std::string& fleet, const RecordKind& kind, std::int64_t last) {
  Statement s(db_, file_,
              "INSERT OR REPLACE INTO handed (fleet, kind, last, at) VALUES (?1, ?2, ?3, julianday('now'))");
  s.bind(1, fleet);
  s.bind(2, kind.table);
  s.bind(3, last);
  s.step();
}

std::string SqliteStore::lastFleet() const {
  Statement s(db_, file_, "SELECT fleet FROM handed ORDER BY at DESC LIMIT 1");
  return s.step() ? s.word(0) : "";
}

std::size_t SqliteStore::addFrom(const std::string& fleet, const RecordKind& kind,
                                 const std::vector<Row>& rows) {
  std::size_t added = 0;
  transaction([&] {
    const bool nothing_waits = unsentCount(fleet, kind) == 0;
    added = insert(kind, rows);
    if (!nothing_waits || added == 0) return;
    Statement last(db_, file_, "SELECT max(id) FROM " + kind.table);
    last.step();
    markSent(fleet, kind, last.whole(0));
  });
  return added;
}

std::vector<std::string> SqliteStore::identities(const RecordKind& kind) const {
  Statement s(db_, file_, "SELECT identity FROM " + kind.table);
  std::vector<std::string> found;
  while (s.step()) found.push_back(s.word(0));
  return found;
}

}  // namespace smartmill::loadmeter
