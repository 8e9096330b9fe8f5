#include "fleet_connection.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_loadmeter/database/fleet.h"

namespace smartmill::loadmeter {

namespace {

// Messages of libpq have several lines.
std::string oneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  std::replace(text.begin(), text.end(), '\t', ' ');
  std::string line;
  for (const char c : text) {
    if (c != ' ' || (!line.empty() && line.back() != ' ')) line += c;
  }
  while (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

}  // namespace

double QueryResult::number(int row, int column) const {
  if (PQgetisnull(result_.get(), row, column)) return std::numeric_limits<double>::quiet_NaN();
  return std::strtod(PQgetvalue(result_.get(), row, column), nullptr);
}

std::size_t QueryResult::affected() const {
  return std::strtoull(PQcmdTuples(result_.get()), nullptr, 10);
}

FleetConnection::FleetConnection(const std::string& url)
    : displayed_url_(withoutPassword(url)), connection_(nullptr, PQfinish) {
  // The address may override these values. A broken connection is detected within seconds.
  const char* keys[] = {"connect_timeout",
                        "tcp_user_timeout",
                        "keepalives_idle",
                        "keepalives_interval",
                        "fallback_application_name",
                        "dbname",
                        nullptr};
  const char* values[] = {"5", "10000", "5", "2", "smartmill", url.c_str(), nullptr};
  connection_.reset(PQconnectdbParams(keys, values, 1));
  if (PQstatus(connection_.get()) != CONNECTION_OK) fail(PQerrorMessage(connection_.get()));
  PQsetNoticeProcessor(
      connection_.get(), [](void*, const char*) {}, nullptr);
  if (PQsetClientEncoding(connection_.get(), "UTF8") != 0) fail(PQerrorMessage(connection_.get()));
}

void FleetConnection::fail(const std::string& what) const {
  throw Error(displayed_url_ + ": " + oneLine(what));
}

QueryResult FleetConnection::requireSuccess(PGresult* result) const {
  QueryResult rows(result);
  const ExecStatusType status = PQresultStatus(result);
  if (status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK) {
    const std::string what = result ? PQresultErrorMessage(result) : "";
    fail(what.empty() ? PQerrorMessage(connection_.get()) : what);
  }
  return rows;
}

QueryResult FleetConnection::execute(const std::string& sql) {
  return requireSuccess(PQexec(connection_.get(), sql.c_str()));
}

QueryResult FleetConnection::query(const std::string& sql, const std::vector<std::string>& parameters) {
  const auto at = std::find(prepared_.begin(), prepared_.end(), sql);
  const std::string statement = "s" + std::to_string(at - prepared_.begin());
  const int count = static_cast<int>(parameters.size());
  if (at == prepared_.end()) {
    requireSuccess(PQprepare(connection_.get(), statement.c_str(), sql.c_str(), count, nullptr));
    prepared_.push_back(sql);
  }
  std::vector<const char*> values;
  for (const std::string& p : parameters) values.push_back(p.c_str());
  return requireSuccess(
      PQexecPrepared(connection_.get(), statement.c_str(), count, values.data(), nullptr, nullptr, 0));
}

void FleetConnection::copyIn(const std::string& sql, const std::string& lines) {
  PGresult* start = PQexec(connection_.get(), sql.c_str());
  const bool ready = PQresultStatus(start) == PGRES_COPY_IN;
  const std::string message = PQresultErrorMessage(start);
  PQclear(start);
  if (!ready) fail(message);
  if (PQputCopyData(connection_.get(), lines.data(), static_cast<int>(lines.size())) != 1 ||
      PQputCopyEnd(connection_.get(), nullptr) != 1)
    fail(PQerrorMessage(connection_.get()));
  std::string what;
  while (PGresult* result = PQgetResult(connection_.get())) {
    if (PQresultStatus(result) != PGRES_COMMAND_OK) what = PQresultErrorMessage(result);
    PQclear(result);
  }
  if (!what.empty()) fail(what);
}

std::string FleetConnection::literal(const std::string& word) const {
  return escaped(PQescapeLiteral(connection_.get(), word.c_str(), word.size()));
}

std::string FleetConnection::name(const std::string& word) const {
  return escaped(PQescapeIdentifier(connection_.get(), word.c_str(), word.size()));
}

std::string FleetConnection::escaped(char* text) const {
  if (!text) fail(PQerrorMessage(connection_.get()));
  std::string result(text);
  PQfreemem(text);
  return result;
}

}  // namespace smartmill::loadmeter
