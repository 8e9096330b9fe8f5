#pragma once

#include <libpq-fe.h>

#include <memory>
#include <string>
#include <vector>

namespace smartmill::loadmeter {

/// Result of a command: rows of text. NULL numbers are NaN, NULL text is empty.
class QueryResult {
 public:
  explicit QueryResult(PGresult* result) : result_(result, PQclear) {}
  int size() const { return PQntuples(result_.get()); }
  std::string word(int row, int column) const { return PQgetvalue(result_.get(), row, column); }
  double number(int row, int column) const;
  std::size_t affected() const;

 private:
  std::unique_ptr<PGresult, decltype(&PQclear)> result_;
};

/// Connection of libpq that reports failures as Error "URL: reason" in one line. By hand, because libpqxx has
/// no common interface for parameters and COPY in Debian 12 (6.4) and 13 (7.10).
class FleetConnection {
 public:
  explicit FleetConnection(const std::string& url);

  /// Executes commands without parameters.
  QueryResult execute(const std::string& sql);
  /// Executes one command with parameters $1.., prepared on first use.
  QueryResult query(const std::string& sql, const std::vector<std::string>& parameters);
  /// Sends lines of the text format to "COPY ... FROM STDIN".
  void copyIn(const std::string& sql, const std::string& lines);
  std::string literal(const std::string& word) const;  ///< as a literal
  std::string name(const std::string& word) const;     ///< as an identifier

  /// Runs work between BEGIN and COMMIT; an exception rolls it back.
  template <typename Work>
  void transaction(const char* begin, const Work& work) {
    execute(begin);
    try {
      work();
      execute("COMMIT");
    } catch (...) {
      PQclear(PQexec(connection_.get(), "ROLLBACK"));
      throw;
    }
  }

  [[noreturn]] void fail(const std::string& what) const;

 private:
  QueryResult requireSuccess(PGresult* result) const;
  std::string escaped(char* text) const;

  std::string displayed_url_;
  std::unique_ptr<PGconn, decltype(&PQfinish)> connection_;
  std::vector<std::string> prepared_;
};

}  // namespace smartmill::loadmeter
