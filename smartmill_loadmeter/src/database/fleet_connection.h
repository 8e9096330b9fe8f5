#pragma once

#include <libpq-fe.h>

#include <memory>
#include <string>
#include <vector>

namespace smartmill::loadmeter {

/// Answer to a command: rows of text. NULL numbers are NaN, NULL words empty.
class FleetRows {
 public:
  explicit FleetRows(PGresult* result) : result_(result, PQclear) {}
  int size() const { return PQntuples(result_.get()); }
  std::string word(int row, int column) const { return PQgetvalue(result_.get(), row, column); }
  double number(int row, int column) const;
  std::size_t affected() const;

 private:
  std::unique_ptr<PGresult, decltype(&PQclear)> result_;
};

/// A connection of libpq whose every failure is an Error "URL: what" in one line.
class FleetConnection {
 public:
  explicit FleetConnection(const std::string& url);

  /// Any commands, without parameters.
  FleetRows run(const std::string& sql);
  /// One command with parameters $1.., prepared when it comes for the first time.
  FleetRows ask(const std::string& sql, const std::vector<std::string>& parameters);
  /// Lines of the text format into what "COPY ... FROM STDIN" names.
  void copyIn(const std::string& sql, const std::string& lines);
  std::string quoted(const std::string& word) const;  ///< as a literal
  std::string name(const std::string& word) const;    ///< as an identifier

  /// Work between BEGIN and COMMIT; anything thrown takes all of it back.
  template <typename Work>
  void transaction(const char* begin, const Work& work) {
    run(begin);
    try {
      work();
      run("COMMIT");
    } catch (...) {
      PQclear(PQexec(connection_.get(), "ROLLBACK"));
      throw;
    }
  }

  [[noreturn]] void fail(const std::string& what) const;

 private:
  FleetRows checked(PGresult* result) const;

  std::string shown_;
  std::unique_ptr<PGconn, decltype(&PQfinish)> connection_;
  std::vector<std::string> prepared_;
};

}  // namespace smartmill::loadmeter
