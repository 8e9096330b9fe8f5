// Implementation of fleet_server.h by PostgreSQL. Tables: fleet_schema.cpp.
#include <algorithm>
#include <cmath>
#include <string_view>

#include "fleet_connection.h"
#include "fleet_schema.h"
#include "fleet_server.h"
#include "record_fields.h"

namespace smartmill::loadmeter {

namespace {

void appendWord(const std::string& word, std::string* line) {
  constexpr std::string_view SPECIAL = "\\\t\n\r", LETTER = "\\tnr";
  for (const char c : word) {
    const std::size_t at = SPECIAL.find(c);
    if (at == std::string_view::npos) {
      *line += c;
    } else {
      *line += '\\';
      *line += LETTER[at];
    }
  }
}

// A line of COPY's text format, in the order of RecordKind::columns().
void appendLine(const RecordKind& kind, const Row& row, std::string* lines) {
  *lines += row.identity;
  if (kind.by_speed) *lines += "\t" + std::to_string(row.speed_bucket);
  for (const std::string& word : row.words) {
    *lines += '\t';
    appendWord(word, lines);
  }
  for (const double value : row.numbers) {
    const std::string number = exactNumber(value);
    *lines += '\t' + (number.empty() ? "\\N" : number);
  }
  *lines += '\n';
}

std::vector<Row> rowsOf(const RecordKind& kind, const QueryResult& rows) {
  std::vector<Row> found;
  for (int r = 0; r < rows.size(); ++r) {
    Row row;
    int column = 0;
    row.identity = rows.word(r, column++);
    if (kind.by_speed) row.speed_bucket = static_cast<std::int64_t>(rows.number(r, column++));
    for (std::size_t i = 0; i < kind.words.size(); ++i) row.words.push_back(rows.word(r, column++));
    for (std::size_t i = 0; i < kind.numbers.size(); ++i) row.numbers.push_back(rows.number(r, column++));
    found.push_back(row);
  }
  return found;
}

CoefficientRecord recordOf(const QueryResult& rows, int row) {
  CoefficientRecord record;
  int column = 0;
  for (const TextField& f : textFields()) f.at(record) = rows.word(row, column++);
  for (const NumberField& f : numberFields()) f.set(record, f.index, rows.number(row, column++));
  return record;
}

std::vector<CoefficientRecord> recordsOf(const QueryResult& rows) {
  std::vector<CoefficientRecord> records;
  for (int row = 0; row < rows.size(); ++row) records.push_back(recordOf(rows, row));
  return records;
}

std::string columnsOf(const std::string& table) {
  std::string list;
  for (const TextField& f : textFields()) list += (list.empty() ? "" : ", ") + table + "." + f.name;
  for (const NumberField& f : numberFields()) list += ", " + table + "." + f.name;
  return list;
}

/// Condition " WHERE material = $1 AND tool = $2" of a query, and its parameters.
struct Pair {
  std::string where;
  std::vector<std::string> parameters;

  Pair(const std::string& tool, const std::string& material) {
    if (!material.empty()) add("material", material);
    if (!tool.empty()) add("tool", tool);
  }
  void add(const std::string& column, const std::string& word) {
    parameters.push_back(word);
    where += (where.empty() ? " WHERE " : " AND ") + column + " = $" + std::to_string(parameters.size());
  }
};

class PostgresqlServer : public FleetServer {
 public:
  explicit PostgresqlServer(const std::string& url) : connection_(url) {
    identity_ = checkFleet(connection_);
  }

  std::string identity() override { return identity_; }
  void echo() override { connection_.query("SELECT 1", {}); }

  std::size_t add(const RecordKind& kind, const std::vector<Row>& rows) override {
    if (connection_.query("SELECT (me()).id", {}).word(0, 0).empty())
      connection_.fail("this login is not a machine of the fleet; enrol it with `coefficients_db URL enrol`");
    const std::string list = kind.columns();
    std::string lines;
    for (const Row& row : rows) appendLine(kind, row, &lines);
    std::size_t added = 0;
    connection_.transaction("BEGIN", [&] {
      connection_.execute("CREATE TEMP TABLE incoming ON COMMIT DROP AS SELECT " + list + " FROM " +
                          kind.table + " WITH NO DATA");
      connection_.copyIn("COPY incoming (" + list + ") FROM STDIN", lines);
      // A fixed order prevents a deadlock of two machines with the same records.
      added =
          connection_
              .execute("INSERT INTO " + kind.table + " (shop, machine_id, " + list +
                       ") SELECT m.shop, m.id, incoming.* FROM incoming, me() m ORDER BY incoming.identity "
                       "ON CONFLICT (shop, identity) DO NOTHING")
              .affected();
    });
    return added;
  }

  std::vector<Row> rows(const RecordKind& kind) override {
    return rowsOf(kind, connection_.execute("SELECT " + kind.columns() + " FROM " + kind.table +
                                            " ORDER BY stamp, id"));
  }

  void storePush(const FleetTransfer& done, std::size_t behind) override {
    connection_.query(
        "INSERT INTO push (machine_id, shop, offered, fresh, behind) SELECT m.id, m.shop, $1, $2, $3 FROM "
        "me() m",
        {std::to_string(done.offered), std::to_string(done.fresh), std::to_string(behind)});
  }

  std::optional<CoefficientRecord> newest(const std::string& tool, const std::string& material) override {
    const Pair pair(tool, material);
    const QueryResult rows = connection_.query(
        "SELECT " + columns() + " FROM coefficients" + pair.where + " ORDER BY stamp DESC, id DESC LIMIT 1",
        pair.parameters);
    if (rows.size() == 0) return std::nullopt;
    return recordOf(rows, 0);
  }

  std::vector<CoefficientRecord> records(const std::string& tool, const std::string& material) override {
    const Pair pair(tool, material);
    return recordsOf(connection_.query(
        "SELECT " + columns() + " FROM coefficients" + pair.where + " ORDER BY stamp, id", pair.parameters));
  }

  // One query, whether there are records near that speed or not.
  std::vector<CoefficientRecord> near(const std::string& tool, const CoefficientQuery& query) override {
    Pair pair(tool, query.material);
    const std::string newest = " ORDER BY stamp DESC LIMIT " + std::to_string(NEWEST);
    const std::string any = "SELECT " + columns() + " FROM coefficients" + pair.where + newest;
    if (!(query.cutting_speed > 0.0)) return recordsOf(connection_.query(any, pair.parameters));
    pair.parameters.push_back(std::to_string(bucketOf(query.cutting_speed)));
    const std::string middle = "$" + std::to_string(pair.parameters.size()) + "::int";
    const std::string span = std::to_string(BUCKETS);
    return recordsOf(connection_.query(
        "WITH about AS MATERIALIZED (SELECT " + columnsOf("c") + " FROM (SELECT " + std::to_string(NO_SPEED) +
            " AS at UNION ALL SELECT " + middle + " + b FROM generate_series(-" + span + ", " + span +
            ") b) buckets, LATERAL (SELECT * FROM coefficients" + pair.where +
            (pair.where.empty() ? " WHERE" : " AND") + " speed_bucket = buckets.at" + newest +
            ") c) SELECT * FROM about UNION ALL SELECT * FROM (" + any +
            ") anywhere WHERE NOT EXISTS (SELECT 1 FROM about)",
        pair.parameters));
  }

  std::vector<std::pair<std::string, std::string>> pairs() override {
    const QueryResult rows =
        connection_.execute("SELECT DISTINCT tool, material FROM coefficients ORDER BY 1, 2");
    std::vector<std::pair<std::string, std::string>> found;
    for (int row = 0; row < rows.size(); ++row) found.emplace_back(rows.word(row, 0), rows.word(row, 1));
    return found;
  }

  std::size_t size() override {
    return static_cast<std::size_t>(connection_.execute("SELECT count(*) FROM coefficients").number(0, 0));
  }

  void missing(const RecordKind& kind, const std::vector<std::string>& identities,
               const std::function<void(const std::vector<Row>&)>& batch) override {
    std::string lines;
    for (const std::string& identity : identities) lines += identity + "\n";
    connection_.transaction("BEGIN ISOLATION LEVEL REPEATABLE READ", [&] {
      connection_.execute("CREATE TEMP TABLE have (identity text) ON COMMIT DROP");
      connection_.copyIn("COPY have FROM STDIN", lines);
      connection_.execute("ANALYZE have");
      connection_.execute("DECLARE lacking NO SCROLL CURSOR FOR SELECT " + kind.columns("c.") + " FROM " +
                          kind.table +
                          " c WHERE NOT EXISTS (SELECT 1 FROM have h WHERE h.identity = c.identity) ORDER BY "
                          "c.id");
      while (true) {
        const std::vector<Row> some =
            rowsOf(kind, connection_.execute("FETCH " + std::to_string(FLEET_BATCH) + " FROM lacking"));
        if (some.empty()) break;
        batch(some);
      }
    });
  }

  std::vector<FleetMember> members() override {
    std::string count = "0";
    for (const RecordKind& kind : recordKinds())
      count += " + (SELECT count(*) FROM " + kind.table + " c WHERE c.shop = m.shop AND c.machine_id = m.id)";
    const QueryResult rows = connection_.execute(
        "SELECT m.name, m.login, m.shop, " + count +
        ", extract(epoch FROM now() - p.at), coalesce(p.behind, 0) FROM members() m LEFT "
        "JOIN "
        "LATERAL (SELECT at, behind FROM push WHERE push.shop = m.shop AND push.machine_id = m.id ORDER BY "
        "at DESC "
        "LIMIT 1) p ON true ORDER BY 1");
    std::vector<FleetMember> found;
    for (int row = 0; row < rows.size(); ++row) {
      found.push_back({rows.word(row, 0), rows.word(row, 1), rows.word(row, 2),
                       static_cast<std::size_t>(rows.number(row, 3)), rows.number(row, 4),
                       static_cast<std::size_t>(rows.number(row, 5))});
    }
    return found;
  }

 private:
  FleetConnection connection_;
  std::string identity_;
};

}  // namespace

bool fleetSupported() {
  return true;
}

std::unique_ptr<FleetServer> connectFleet(const std::string& url) {
  return std::make_unique<PostgresqlServer>(url);
}

}  // namespace smartmill::loadmeter
