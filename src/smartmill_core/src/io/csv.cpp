#include "smartmill_core/io/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/io/text_file.h"

namespace smartmill {
namespace {

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r'))
    text.remove_suffix(1);
  return text;
}

}  // namespace

CsvReader::CsvReader(const std::string& file, char separator)
    : file_(file), text_(readText(file)), rest_(text_), separator_(separator) {
  if (rest_.substr(0, 3) == "\xEF\xBB\xBF") rest_.remove_prefix(3);
}

bool CsvReader::nextLine(std::string_view* line) {
  number_ += breaks_;
  breaks_ = 0;
  if (rest_.empty()) return false;
  const std::size_t end = rest_.find('\n');
  *line = trimmed(rest_.substr(0, end));
  rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
  ++number_;
  return true;
}

bool CsvReader::next(std::vector<std::string_view>* cells) {
  cells->clear();
  unquoted_.clear();
  if (separator_ == '\t') {  // blanks at the ends of such a line are not cells
    std::string_view line;
    if (!nextLine(&line)) return false;
    for (std::size_t begin = 0; begin <= line.size();) {
      const std::size_t end = std::min(line.find('\t', begin), line.size());
      cells->push_back(trimmed(line.substr(begin, end - begin)));
      begin = end + 1;
    }
    return true;
  }
  number_ += breaks_;
  breaks_ = 0;
  if (rest_.empty()) return false;
  ++number_;
  for (;;) {
    const std::size_t begin = rest_.find_first_not_of(" \t");
    if (begin != std::string_view::npos && rest_[begin] == '"') {
      rest_.remove_prefix(begin + 1);
      cells->push_back(quotedCell());
    } else {
      std::size_t end = 0;
      while (end < rest_.size() && rest_[end] != separator_ && rest_[end] != '\n') ++end;
      cells->push_back(trimmed(rest_.substr(0, end)));
      rest_.remove_prefix(end);
    }
    if (rest_.empty()) return true;
    const char end = rest_.front();
    rest_.remove_prefix(1);
    if (end == '\n') return true;
    if (rest_.empty()) {  // the file ends with a separator
      cells->push_back({});
      return true;
    }
  }
}

// The cell after an opening quote, up to the separator or the end of the line.
std::string_view CsvReader::quotedCell() {
  std::string& word = unquoted_.emplace_back();
  for (;;) {
    const std::size_t quote = rest_.find('"');
    if (quote == std::string_view::npos) fail("a quote is not closed");
    word += rest_.substr(0, quote);
    rest_.remove_prefix(quote + 1);
    if (rest_.empty() || rest_.front() != '"') break;
    word += '"';
    rest_.remove_prefix(1);
  }
  breaks_ += static_cast<int>(std::count(word.begin(), word.end(), '\n'));
  const std::size_t end = std::min(rest_.find_first_not_of(" \t\r"), rest_.size());
  rest_.remove_prefix(end);
  if (!rest_.empty() && rest_.front() != separator_ && rest_.front() != '\n')
    fail("text after a quoted cell (expected a separator)");
  return word;
}

bool CsvReader::nextFilled(std::vector<std::string_view>* cells) {
  while (next(cells)) {
    if (!isBlank(*cells)) return true;
  }
  return false;
}

bool CsvReader::restIsBlank() const {
  return rest_.find_first_not_of(" \t\r\n") == std::string_view::npos;
}

double CsvReader::number(std::string_view cell, std::string_view column) const {
  const char* const last = cell.data() + cell.size();
  double value = 0.0;
  const auto [parsed, code] =
      std::from_chars(cell.data() + (!cell.empty() && cell.front() == '+'), last, value);
  if (code != std::errc() || parsed != last)
    fail("column " + std::string(column) + ": '" + std::string(cell) + "' is not a number");
  if (!std::isfinite(value))
    fail("column " + std::string(column) + ": '" + std::string(cell) + "' is not a finite number");
  return value;
}

void CsvReader::fail(const std::string& what) const {
  throw Error(file_ + ": line " + std::to_string(number_) + ": " + what);
}

bool isBlank(const std::vector<std::string_view>& cells) {
  return cells.size() == 1 && cells.front().empty();
}

bool NumberTable::has(const std::string& name) const {
  return std::any_of(names.begin(), names.end(),
                     [&](const std::string& n) { return n == name || n.substr(0, n.find('[')) == name; });
}

const std::vector<double>& NumberTable::column(const std::string& name) const {
  for (std::size_t c = 0; c < names.size(); ++c) {
    if (names[c] == name || names[c].substr(0, names[c].find('[')) == name) return columns[c];
  }
  throw Error(file + ": column " + name + " is missing");
}

NumberTable readNumberTable(const std::string& file) {
  CsvReader reader(file);
  std::vector<std::string_view> cells;
  if (!reader.next(&cells)) throw Error(file + ": is empty");
  NumberTable table;
  table.file = file;
  table.names.assign(cells.begin(), cells.end());
  table.columns.resize(table.names.size());
  while (reader.nextFilled(&cells)) {
    if (cells.size() != table.names.size())
      reader.fail(std::to_string(cells.size()) + " values, expected " + std::to_string(table.names.size()) +
                  " (one per column)");
    for (std::size_t c = 0; c < cells.size(); ++c) {
      table.columns[c].push_back(cells[c].empty() || cells[c] == "nan"
                                     ? std::numeric_limits<double>::quiet_NaN()
                                     : reader.number(cells[c], table.names[c]));
    }
  }
  return table;
}

std::vector<std::vector<double>> readColumns(const std::string& file, const std::vector<std::string>& names) {
  CsvReader reader(file);
  std::vector<std::string_view> cells;
  if (!reader.next(&cells)) throw Error(file + ": is empty");
  std::vector<std::size_t> position;
  for (const std::string& name : names) {
    const auto at = std::find(cells.begin(), cells.end(), name);
    if (at == cells.end()) throw Error(file + ": column " + name + " is missing");
    position.push_back(static_cast<std::size_t>(at - cells.begin()));
  }
  std::vector<std::vector<double>> columns(names.size());
  std::size_t rows = 0;
  for (; reader.nextFilled(&cells); ++rows) {
    for (std::size_t c = 0; c < names.size(); ++c)
      columns[c].push_back(reader.number(position[c] < cells.size() ? cells[position[c]] : "", names[c]));
  }
  if (rows == 0) throw Error(file + ": no rows");
  return columns;
}

CsvWriter::CsvWriter(const std::string& header, int digits) : text_(header + "\n"), digits_(digits) {
}

void CsvWriter::separate() {
  if (begun_) text_ += ',';
  begun_ = true;
}

CsvWriter& CsvWriter::cell(double value) {
  separate();
  char number[40];
  if (std::isfinite(value))
    text_.append(number, std::snprintf(number, sizeof number, "%.*g", digits_, value));
  return *this;
}

CsvWriter& CsvWriter::cell(int value) {
  separate();
  text_ += std::to_string(value);
  return *this;
}

CsvWriter& CsvWriter::cell(std::size_t value) {
  separate();
  text_ += std::to_string(value);
  return *this;
}

CsvWriter& CsvWriter::cell(const std::string& word) {
  separate();
  text_ += csvCell(word);
  return *this;
}

void CsvWriter::endRow() {
  text_ += '\n';
  begun_ = false;
}

void CsvWriter::gap() {
  text_ += '\n';
}

void CsvWriter::save(const std::string& file) const {
  writeText(file, text_);
}

std::string csvCell(const std::string& word) {
  if (word.find_first_of(",\"\n\r") == std::string::npos) return word;
  std::string out = "\"";
  for (const char c : word) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

}  // namespace smartmill
