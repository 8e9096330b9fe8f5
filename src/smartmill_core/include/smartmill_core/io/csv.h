#pragma once

#include <cstddef>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

namespace smartmill {

/// Rows of a text table, cell by cell. Cells are trimmed; a cell in double quotes may hold separators, line
/// breaks and doubled quotes. Every error is one line "FILE: line N: what".
class CsvReader {
 public:
  /// @throws Error when the file cannot be read.
  explicit CsvReader(const std::string& file, char separator = ',');

  /// The next row; a blank line is a row of one empty cell. The views live until the next call. @return false
  /// at the end
  bool next(std::vector<std::string_view>* cells);

  /// The same, skipping blank lines.
  bool nextFilled(std::vector<std::string_view>* cells);

  /// The next line as it is, without its end. @return false at the end
  bool nextLine(std::string_view* line);

  void setSeparator(char separator) { separator_ = separator; }

  /// Whether only blank lines remain.
  bool restIsBlank() const;

  /// Number of the line that next() read last, from 1.
  int line() const { return number_; }
  const std::string& file() const { return file_; }

  /// A finite number. @param column for the message. @throws Error naming line and column.
  double number(std::string_view cell, std::string_view column) const;

  [[noreturn]] void fail(const std::string& what) const;

 private:
  std::string_view quotedCell();

  std::string file_, text_;
  std::string_view rest_;
  std::deque<std::string> unquoted_;
  char separator_;
  int number_ = 0, breaks_ = 0;  // line where the last row began; line breaks inside its quotes
};

bool isBlank(const std::vector<std::string_view>& cells);

/// Columns of numbers below a header of names, name or name[unit].
struct NumberTable {
  std::string file;
  std::vector<std::string> names;            ///< as in the file
  std::vector<std::vector<double>> columns;  ///< NaN where a cell is empty or "nan"

  bool has(const std::string& name) const;
  /// By name with or without its unit. @throws Error when it is missing.
  const std::vector<double>& column(const std::string& name) const;
};

/// Every cell is a number or empty. @throws Error naming file, line and column.
NumberTable readNumberTable(const std::string& file);

/// The named columns in the given order, with the exact names of the file and a number in every row. Other
/// columns may contain anything.
/// @throws Error naming file, line and column: missing column, not a number, no rows.
std::vector<std::vector<double>> readColumns(const std::string& file, const std::vector<std::string>& names);

/// Writes a table row by row; numbers that are not finite give an empty cell, words are quoted where
/// necessary.
class CsvWriter {
 public:
  /// @param digits significant digits of a number
  explicit CsvWriter(const std::string& header, int digits = 9);

  template <typename... Cells>
  void row(const Cells&... cells) {
    (cell(cells), ...);
    endRow();
  }
  CsvWriter& cell(double value);
  CsvWriter& cell(int value);
  CsvWriter& cell(std::size_t value);
  CsvWriter& cell(const std::string& word);
  CsvWriter& cell(const char* word) { return cell(std::string(word)); }
  void endRow();
  /// A blank line, which separates curves for gnuplot.
  void gap();

  const std::string& text() const { return text_; }
  /// @throws Error "FILE: cannot be written".
  void save(const std::string& file) const;

 private:
  void separate();

  std::string text_;
  int digits_;
  bool begun_ = false;
};

/// A word as a cell: quoted where it contains a comma, a quote or a line break.
std::string csvCell(const std::string& word);

}  // namespace smartmill
