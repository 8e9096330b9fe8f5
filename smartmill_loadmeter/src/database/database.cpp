#include "smartmill_loadmeter/database/database.h"

#include <sqlite3.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <set>

#include "fleet_server.h"
#include "record_fields.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/version.h"

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

// Records carry the version of the software.
template <typename Record>
std::vector<Row> rowsOf(const std::string& file, const std::vector<Record>& records) {
  std::vector<Row> rows;
  for (Record record : records) {
    if (record.version.empty()) record.version = smartmill::version();
    try {
      rows.push_back(rowOf(record));
    } catch (const Error& error) {
      throw Error(withoutPassword(file) + ": " + error.what());
    }
  }
  return rows;
}

template <typename Record>
std::vector<Record> recordsOf(const std::vector<Row>& rows) {
  std::vector<Record> records(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) readRow(rows[i], &records[i]);
  return records;
}

}  // namespace

struct CoefficientDatabase::Impl {
  std::string file;
  sqlite3* db = nullptr;
  std::unique_ptr<FleetServer> fleet;  // used instead of the file

  explicit Impl(const std::string& path) : file(path.empty() ? ":memory:" : path) {
    if (isServerUrl(path)) {
      fleet = connectFleet(path);
      return;
    }
    const int code = sqlite3_open_v2(
        file.c_str(), &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX, nullptr);
    try {
      if (code != SQLITE_OK) throw Error(file + ": " + (db ? sqlite3_errmsg(db) : "cannot be opened"));
      sqlite3_busy_timeout(db, BUSY_TIMEOUT);
      prepare();
    } catch (...) {
      sqlite3_close(db);
      throw;
    }
  }
  ~Impl() { sqlite3_close(db); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void execute(const std::string& sql) const {
    char* message = nullptr;
    if (sqlite3_exec(db, sql.c_str(), nullptr, nullptr, &message) == SQLITE_OK) return;
    const std::string what = message ? message : "failed";
    sqlite3_free(message);
    throw Error(file + ": " + what);
  }

  int version() const {
    Statement s(db, file, "PRAGMA user_version");
    return s.step() ? s.integer(0) : 0;
  }

  void prepare() const {
    // The journal mode is stored in the file, so that only one process switches it.
    Statement mode(db, file, "PRAGMA journal_mode");
    const bool is_wal = mode.step() && mode.word(0) == "wal";
    mode.reset();
    for (int tries = 0; !is_wal; ++tries) {
      try {
        execute("PRAGMA journal_mode=WAL");
        break;
      } catch (const Error&) {
        // SQLite does not wait for other processes when it switches the mode.
        if (tries == 200 || sqlite3_errcode(db) != SQLITE_BUSY) throw;
        sqlite3_sleep(20);
      }
    }
    execute("PRAGMA synchronous=FULL");
    if (version() < SCHEMA) {
      transaction([this] {
        // Another process may have done it meanwhile.
        if (version() == 0) makeFirst();
        if (version() == 1) makeSecond();
      });
    }
    if (version() != SCHEMA) {
      throw Error(file + ": schema " + std::to_string(version()) + ", expected at most " +
                  std::to_string(SCHEMA));
    }
  }

  std::string createOf(const RecordKind& kind) const {
    std::string sql =
        "CREATE TABLE " + kind.table + " (id INTEGER PRIMARY KEY, identity TEXT NOT NULL UNIQUE";
    if (kind.by_speed) sql += ", speed_bucket INTEGER NOT NULL";
    for (const std::string& name : kind.words) sql += ", " + name + " TEXT NOT NULL";
    for (const std::string& name : kind.numbers) sql += ", " + name + " REAL";
    return sql + ")";
  }

  void makeFirst() const {
    {
      Statement tables(db, file, "SELECT count(*) FROM sqlite_master");
      if (tables.step() && tables.integer(0) > 0) {
        throw Error(file + ": not a database of cutting coefficients");
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
  void makeSecond() const {
    execute(createOf(improvementKind()));
    execute(createOf(healthKind()));
    execute(
        "CREATE TABLE handed (fleet TEXT, kind TEXT, last INTEGER, at REAL, PRIMARY KEY (fleet, kind));"
        "CREATE TABLE IF NOT EXISTS sent (fleet TEXT PRIMARY KEY, last INTEGER, at REAL);"
        "INSERT INTO handed SELECT fleet, 'coefficients', last, at FROM sent;"
        "DROP TABLE sent");
    execute("PRAGMA user_version=2");
  }

  template <typename Work>
  void transaction(const Work& work) const {
    execute("BEGIN IMMEDIATE");
    try {
      work();
      execute("COMMIT");
    } catch (...) {
      sqlite3_exec(db, "ROLLBACK", nullptr, nullptr, nullptr);
      throw;
    }
  }

  std::size_t insert(const RecordKind& kind, const std::vector<Row>& rows) const;
  std::int64_t sentUpTo(const std::string& to, const RecordKind& kind) const;

  std::string where(const std::string& tool, const std::string& material) const {
    std::string sql;
    if (!material.empty()) sql += " WHERE material = ?1";
    if (!tool.empty()) sql += std::string(sql.empty() ? " WHERE" : " AND") + " tool = ?2";
    return sql;
  }
  static void bindPair(Statement& s, const std::string& tool, const std::string& material) {
    if (!material.empty()) s.bind(1, material);
    if (!tool.empty()) s.bind(2, tool);
  }
};

CoefficientDatabase::CoefficientDatabase(const std::string& file) : impl_(std::make_unique<Impl>(file)) {
}
CoefficientDatabase::~CoefficientDatabase() = default;

bool CoefficientDatabase::add(const CoefficientRecord& record) {
  return add(std::vector<CoefficientRecord>{record}) == 1;
}

bool CoefficientDatabase::add(const CoefficientSet& set) {
  CoefficientRecord record;
  record.set = set;
  return add(record);
}

std::size_t CoefficientDatabase::add(const std::vector<CoefficientRecord>& records) {
  return add(coefficientKind(), rowsOf(impl_->file, records));
}

std::size_t CoefficientDatabase::add(const std::vector<ModelImprovement>& improvements) {
  return add(improvementKind(), rowsOf(impl_->file, improvements));
}

std::size_t CoefficientDatabase::add(const std::vector<HealthRecord>& health) {
  return add(healthKind(), rowsOf(impl_->file, health));
}

std::size_t CoefficientDatabase::add(const RecordKind& kind, const std::vector<Row>& rows) {
  if (impl_->fleet) return impl_->fleet->add(kind, rows);
  std::size_t added = 0;
  impl_->transaction([&] { added = impl_->insert(kind, rows); });
  return added;
}

std::size_t CoefficientDatabase::Impl::insert(const RecordKind& kind, const std::vector<Row>& rows) const {
  std::size_t added = 0;
  std::string marks = "?1";
  const std::size_t count = kind.words.size() + kind.numbers.size() + (kind.by_speed ? 1 : 0);
  for (std::size_t i = 0; i < count; ++i) marks += ", ?" + std::to_string(i + 2);
  Statement insert(
      db, file, "INSERT OR IGNORE INTO " + kind.table + " (" + kind.columns() + ") VALUES (" + marks + ")");
  for (const Row& row : rows) {
    int at = 1;
    insert.bind(at++, row.identity);
    if (kind.by_speed) insert.bind(at++, row.speed_bucket);
    for (const std::string& word : row.words) insert.bind(at++, word);
    for (const double number : row.numbers) insert.bind(at++, number);
    insert.step();
    added += static_cast<std::size_t>(sqlite3_changes(db));
    insert.reset();
  }
  return added;
}

std::vector<Row> CoefficientDatabase::rows(const RecordKind& kind) const {
  if (impl_->fleet) return impl_->fleet->rows(kind);
  Statement s(impl_->db, impl_->file,
              "SELECT " + kind.columns() + " FROM " + kind.table + " ORDER BY stamp, id");
  std::vector<Row> found;
  while (s.step()) found.push_back(rowOf(kind, s));
  return found;
}

std::vector<ModelImprovement> CoefficientDatabase::improvements() const {
  return recordsOf<ModelImprovement>(rows(improvementKind()));
}

std::vector<HealthRecord> CoefficientDatabase::health() const {
  return recordsOf<HealthRecord>(rows(healthKind()));
}

std::optional<CoefficientSet> CoefficientDatabase::find(const std::string& tool,
                                                        const std::string& material) const {
  if (impl_->fleet) {
    const auto newest = impl_->fleet->newest(tool, material);
    return newest ? std::optional(newest->set) : std::nullopt;
  }
  Statement s(impl_->db, impl_->file,
              "SELECT " + columns() + " FROM coefficients" + impl_->where(tool, material) +
                  " ORDER BY stamp DESC, id DESC LIMIT 1");
  Impl::bindPair(s, tool, material);
  if (!s.step()) return std::nullopt;
  return recordOf(s).set;
}

std::vector<CoefficientRecord> CoefficientDatabase::records(const std::string& tool,
                                                            const std::string& material) const {
  if (impl_->fleet) return impl_->fleet->records(tool, material);
  Statement s(
      impl_->db, impl_->file,
      "SELECT " + columns() + " FROM coefficients" + impl_->where(tool, material) + " ORDER BY stamp, id");
  Impl::bindPair(s, tool, material);
  std::vector<CoefficientRecord> found;
  while (s.step()) found.push_back(recordOf(s));
  return found;
}

std::size_t CoefficientDatabase::size() const {
  if (impl_->fleet) return impl_->fleet->size();
  Statement s(impl_->db, impl_->file, "SELECT count(*) FROM coefficients");
  return s.step() ? static_cast<std::size_t>(s.number(0)) : 0;
}

std::size_t CoefficientDatabase::merge(const std::string& file) {
  std::FILE* there = std::fopen(file.c_str(), "rb");
  if (!there) throw Error(file + ": cannot be read");
  std::fclose(there);
  const CoefficientDatabase other(file);
  std::size_t added = 0;
  for (const RecordKind& kind : recordKinds()) added += add(kind, other.rows(kind));
  return added;
}

std::string CoefficientDatabase::contents() const {
  std::string text;
  const auto add = [&](const std::string& tool, const std::string& material) {
    text += (text.empty() ? "" : ", ") + tool + " / " + material;
  };
  if (impl_->fleet) {
    for (const auto& [tool, material] : impl_->fleet->pairs()) add(tool, material);
  } else {
    Statement s(impl_->db, impl_->file, "SELECT DISTINCT tool, material FROM coefficients ORDER BY 1, 2");
    while (s.step()) add(s.word(0), s.word(1));
  }
  return text.empty() ? "no records" : text;
}

const std::string& CoefficientDatabase::file() const {
  return impl_->file;
}

// The numbers of records follow the order of insertion, because a file has one writer at a time.
std::int64_t CoefficientDatabase::Impl::sentUpTo(const std::string& to, const RecordKind& kind) const {
  Statement s(db, file, "SELECT last FROM handed WHERE fleet = ?1 AND kind = ?2");
  s.bind(1, to);
  s.bind(2, kind.table);
  return s.step() ? s.whole(0) : 0;
}

CoefficientDatabase::Batch CoefficientDatabase::unsent(const std::string& fleet, const RecordKind& kind,
                                                       std::size_t limit) const {
  Batch batch;
  Statement s(impl_->db, impl_->file,
              "SELECT " + kind.columns() + ", id FROM " + kind.table + " WHERE id > ?1 ORDER BY id LIMIT ?2");
  s.bind(1, impl_->sentUpTo(fleet, kind));
  s.bind(2, static_cast<std::int64_t>(limit));
  const int id = static_cast<int>(kind.words.size() + kind.numbers.size()) + (kind.by_speed ? 2 : 1);
  while (s.step()) {
    batch.rows.push_back(rowOf(kind, s));
    batch.last = s.whole(id);
  }
  return batch;
}

std::size_t CoefficientDatabase::unsentCount(const std::string& fleet, const RecordKind& kind) const {
  Statement s(impl_->db, impl_->file, "SELECT count(*) FROM " + kind.table + " WHERE id > ?1");
  s.bind(1, impl_->sentUpTo(fleet, kind));
  return s.step() ? static_cast<std::size_t>(s.whole(0)) : 0;
}

std::size_t CoefficientDatabase::unsentCount(const std::string& fleet) const {
  std::size_t count = 0;
  for (const RecordKind& kind : recordKinds()) count += unsentCount(fleet, kind);
  return count;
}

void CoefficientDatabase::markSent(const std::string& fleet, const RecordKind& kind, std::int64_t last) {
  Statement s(impl_->db, impl_->file,
              "INSERT OR REPLACE INTO handed (fleet, kind, last, at) VALUES (?1, ?2, ?3, julianday('now'))");
  s.bind(1, fleet);
  s.bind(2, kind.table);
  s.bind(3, last);
  s.step();
}

std::string CoefficientDatabase::lastFleet() const {
  Statement s(impl_->db, impl_->file, "SELECT fleet FROM handed ORDER BY at DESC LIMIT 1");
  return s.step() ? s.word(0) : "";
}

std::size_t CoefficientDatabase::addFrom(const std::string& fleet, const RecordKind& kind,
                                         const std::vector<Row>& rows) {
  std::size_t added = 0;
  impl_->transaction([&] {
    const bool nothing_waits = unsentCount(fleet, kind) == 0;
    added = impl_->insert(kind, rows);
    if (!nothing_waits || added == 0) return;
    Statement last(impl_->db, impl_->file, "SELECT max(id) FROM " + kind.table);
    last.step();
    markSent(fleet, kind, last.whole(0));
  });
  return added;
}

std::vector<std::string> CoefficientDatabase::identities(const RecordKind& kind) const {
  Statement s(impl_->db, impl_->file, "SELECT identity FROM " + kind.table);
  std::vector<std::string> found;
  while (s.step()) found.push_back(s.word(0));
  return found;
}

double distance(const CoefficientRecord& record, const CoefficientQuery& query, const DistanceScale& scale) {
  double sum = 0.0;
  const auto add = [&](double share) {
    if (std::isfinite(share)) sum += share * share;
  };
  add(std::log2(record.cutting_speed / query.cutting_speed) / scale.octaves);
  add(std::log2(record.feed_per_tooth / query.feed_per_tooth) / scale.octaves);
  add(std::log2(record.diameter / query.diameter) / scale.octaves);
  add((record.helix - query.helix) / scale.angle);
  add((record.rake - query.rake) / scale.angle);
  add((record.edge_age - query.edge_age) / scale.age);
  if (!query.tool.empty() && record.set.tool != query.tool) add(scale.other_tool);
  return std::sqrt(sum);
}

// Newest records of a pair near the cutting speed; of any speed if there is none.
std::vector<CoefficientRecord> CoefficientDatabase::near(const std::string& tool,
                                                         const CoefficientQuery& query) const {
  if (impl_->fleet) return impl_->fleet->near(tool, query);
  std::vector<CoefficientRecord> found;
  const std::string select =
      "SELECT " + columns() + " FROM coefficients" + impl_->where(tool, query.material);
  const std::string newest = " ORDER BY stamp DESC LIMIT " + std::to_string(NEWEST);
  const auto collect = [&](Statement& s) {
    while (s.step()) found.push_back(recordOf(s));
    s.reset();
  };
  if (query.cutting_speed > 0.0) {
    const char* also = select.find(" WHERE") == std::string::npos ? " WHERE" : " AND";
    Statement s(impl_->db, impl_->file, select + also + " speed_bucket = ?3" + newest);
    std::vector<int> buckets{NO_SPEED};
    for (int b = -BUCKETS; b <= BUCKETS; ++b) buckets.push_back(bucketOf(query.cutting_speed) + b);
    for (const int bucket : buckets) {
      Impl::bindPair(s, tool, query.material);
      s.bind(3, std::int64_t{bucket});
      collect(s);
    }
  }
  if (found.empty()) {
    Statement any(impl_->db, impl_->file, select + newest);
    Impl::bindPair(any, tool, query.material);
    collect(any);
  }
  return found;
}

namespace {

// One coefficient from all records, each widened by its distance. @return {value, standard deviation}; NaN:
// in no record.
std::array<double, 2> combine(const std::vector<CoefficientRecord>& near,
                              const std::vector<double>& distances, double CuttingCoefficients::*coefficient,
                              double growth) {
  struct Term {
    double value, variance, widened;
  };
  std::vector<Term> terms;
  double weight = 0.0, sum = 0.0, fade = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < near.size(); ++i) {
    const double v = near[i].set.value.*coefficient, s = near[i].set.std_dev.*coefficient;
    if (!std::isfinite(v)) continue;
    // A set without a standard deviation has the uncertainty of distance 1.
    const double own = std::isfinite(s) ? s : growth * std::abs(v), widened = growth * distances[i] * v;
    terms.push_back({v, own * own + widened * widened, widened});
    const double variance = std::max(terms.back().variance, 1e-12 * v * v + 1e-300);
    weight += 1.0 / variance;
    sum += v / variance;
    fade = std::min(fade, std::abs(widened));
  }
  if (!(weight > 0.0)) return {CoefficientRecord::UNKNOWN, CoefficientRecord::UNKNOWN};
  const double value = sum / weight;
  // Scatter beyond the standard deviations: the process changed between the sets.
  double scatter = 0.0;
  for (const Term& t : terms) scatter += (t.value - value) * (t.value - value) / (t.variance + 1e-300);
  const double freedom = static_cast<double>(terms.size()) - 1.0;
  const double factor = freedom > 0.0 ? std::max(1.0, scatter / freedom) : 1.0;
  // The smallest widening is common to all and is not reduced by averaging.
  return {value, std::sqrt(factor / weight + fade * fade)};
}

}  // namespace

std::optional<CoefficientEstimate> CoefficientDatabase::estimate(const CoefficientQuery& query,
                                                                 const DistanceScale& scale) const {
  CoefficientEstimate result;
  std::vector<CoefficientRecord> records = near(query.tool, query);
  if (records.empty() && !query.tool.empty()) {
    records = near("", query);
    result.other_tool = true;
  }
  if (records.empty()) return std::nullopt;
  result.nearest = std::numeric_limits<double>::infinity();
  result.records = static_cast<int>(records.size());
  std::vector<double> distances;
  for (const CoefficientRecord& r : records) {
    distances.push_back(distance(r, query, scale));
    if (distances.back() < result.nearest) {
      result.nearest = distances.back();
      result.set.tool = r.set.tool;
      result.set.material = r.set.material;
      result.set.source = r.set.source;
    }
    result.set.stamp = std::max(result.set.stamp, r.set.stamp);
    result.set.tests += r.set.tests;
  }
  result.set.value = result.set.std_dev = NOT_IDENTIFIED;
  for (const CuttingKey& k : cuttingKeys()) {
    const auto [value, std_dev] = combine(records, distances, k.coefficient, scale.growth);
    result.set.value.*k.coefficient = value;
    result.set.std_dev.*k.coefficient = std_dev;
  }
  return result;
}

FoundCoefficients findCoefficients(const CoefficientDatabase& database, const std::string& tool,
                                   const std::string& material) {
  FoundCoefficients found;
  found.set = database.find(tool, material);
  // Production cuts are combined, which is more certain than the newest.
  if (found.set && found.set->source != SOURCE_PRODUCTION) {
    found.message = "source " + found.set->source + ", " + std::to_string(found.set->tests) + " tests";
    return found;
  }
  CoefficientQuery query;
  query.tool = tool;
  query.material = material;
  if (const auto estimate = database.estimate(query)) {
    found.set = estimate->set;
    if (!estimate->other_tool) {
      found.message = std::to_string(estimate->records) + " identifications and cuts combined";
      return found;
    }
    found.message = "no records with '" + tool + "': from " + std::to_string(estimate->records) + " of '" +
                    estimate->set.tool + "' and other tools, uncertainty widened";
    return found;
  }
  found.message = "no records for '" + tool + "' in '" + material + "'; known: " + database.contents();
  return found;
}

}  // namespace smartmill::loadmeter
