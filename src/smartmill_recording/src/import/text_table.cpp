#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <set>
#include <string_view>

#include "smartmill_core/error.h"
#include "smartmill_core/io/csv.h"
#include "smartmill_recording/import/channel_file.h"
#include "smartmill_recording/import/names.h"
#include "smartmill_recording/import/unit.h"

namespace smartmill::recording {
namespace {

constexpr char BLANKS = ' ';
constexpr std::size_t MOST_PREAMBLE = 200;  // lines in which the numbers must begin
constexpr std::size_t LEAST_ROWS = 3;       // of numbers, one below the other

struct Style {
  char separator = ',';
  bool decimal_comma = false;
};

constexpr Style STYLES[] = {{'\t', false}, {'\t', true},    {';', false},  {';', true},
                            {',', false},  {BLANKS, false}, {BLANKS, true}};

struct Line {
  int number = 0;
  std::string text;
};

std::string_view withoutBlanks(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

/// Cells of a line; quotes around a cell are removed. Runs of blanks are one separator.
void split(std::string_view line, char separator, std::vector<std::string_view>* cells) {
  cells->clear();
  const auto separates = [&](char c) { return separator == BLANKS ? c == ' ' || c == '\t' : c == separator; };
  for (std::size_t at = 0;;) {
    while (at < line.size() && (line[at] == ' ' || (line[at] == '\t' && separator != '\t'))) ++at;
    if (at < line.size() && line[at] == '"') {
      const std::size_t end = std::min(line.find('"', at + 1), line.size());
      cells->push_back(withoutBlanks(line.substr(at + 1, end - at - 1)));
      at = std::min(end + 1, line.size());
      while (at < line.size() && !separates(line[at])) ++at;
    } else {
      std::size_t end = at;
      while (end < line.size() && !separates(line[end])) ++end;
      cells->push_back(withoutBlanks(line.substr(at, end - at)));
      at = end;
    }
    if (at >= line.size()) return;
    ++at;
    if (separator == BLANKS && withoutBlanks(line.substr(at)).empty()) return;
  }
}

// Replaces a decimal comma by a point, in `buffer`.
std::string_view withPoint(std::string_view cell, const Style& style, std::string* buffer) {
  if (!style.decimal_comma || cell.find(',') == std::string_view::npos) return cell;
  if (cell.find('.') != std::string_view::npos) return cell;  // 1.234,5 is not a number
  buffer->assign(cell);
  std::replace(buffer->begin(), buffer->end(), ',', '.');
  return *buffer;
}

bool isNumber(std::string_view cell) {
  double value = 0.0;
  const char* const last = cell.data() + cell.size();
  const auto [end, code] = std::from_chars(cell.data() + (!cell.empty() && cell.front() == '+'), last, value);
  return !cell.empty() && end == last && code != std::errc::invalid_argument;
}

// Separators at a line's end leave an empty cell.
void dropEmptyLast(std::vector<std::string_view>* cells) {
  if (cells->size() > 1 && cells->back().empty()) cells->pop_back();
}

/// Numbers in a line; 0 where one of its cells is not a number.
std::size_t numbersIn(const std::string& line, const Style& style) {
  std::vector<std::string_view> cells;
  split(line, style.separator, &cells);
  dropEmptyLast(&cells);
  std::string buffer;
  for (const std::string_view cell : cells) {
    if (!isNumber(withPoint(cell, style, &buffer))) return 0;
  }
  return cells.size();
}

struct Layout {
  Style style;
  std::size_t first = 0, columns = 0;  // row of the first numbers, among the filled lines
};

/// Where the numbers begin: the style that finds them first, and of those the one with the most columns.
Layout layoutOf(const std::vector<Line>& lines) {
  Layout best;
  for (const Style& style : STYLES) {
    std::size_t rows = 0, columns = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const std::size_t count = numbersIn(lines[i].text, style);
      rows = count > 0 && count == columns ? rows + 1 : count > 0 ? 1 : 0;
      columns = count;
      if (rows < LEAST_ROWS && (i + 1 < lines.size() || rows == 0)) continue;
      const std::size_t first = i + 1 - rows;
      if (best.columns == 0 || first < best.first || (first == best.first && columns > best.columns))
        best = {style, first, columns};
      break;
    }
  }
  return best;
}

bool isUnitRow(const std::vector<std::string_view>& cells) {
  const auto known = [](std::string_view cell) {
    if (cell.size() > 2 && std::string_view("[({<").find(cell.front()) != std::string_view::npos)
      cell = cell.substr(1, cell.size() - 2);
    return cell.empty() || cell == "-" || unitOf(std::string(cell)).has_value();
  };
  return std::all_of(cells.begin(), cells.end(), known) &&
         std::any_of(cells.begin(), cells.end(), [](std::string_view cell) { return !cell.empty(); });
}

/// "Sampling rate [Hz]:,10000" in the lines above the names.
void readRate(const std::string& line, const Style& style, ChannelFile* file) {
  const std::string plain = plainName(line);
  if (plain.rfind("sampl", 0) != 0 || plain.find("hz") == std::string::npos) return;
  std::size_t at = line.find_first_of(":=");
  if (at == std::string::npos) at = line.find(style.separator);
  if (at == std::string::npos) return;
  std::string text;
  for (const char c : line.substr(at + 1)) {
    if (std::isdigit(static_cast<unsigned char>(c)) || c == '.')
      text += c;
    else if (c == ',' && style.decimal_comma && !text.empty())
      text += '.';
    else if (!text.empty())
      break;
  }
  double value = 0.0;
  if (!isNumber(text) || std::from_chars(text.data(), text.data() + text.size(), value).ec != std::errc() ||
      !(value > 0.0))
    return;
  file->sample_rate = value * (plain.find("khz") != std::string::npos ? 1e3 : 1.0);
  file->sample_rate_from = "'" + std::string(withoutBlanks(std::string_view(line).substr(0, at))) + "'";
}

/// Names and units above the first row of numbers.
void readHeader(const std::vector<Line>& lines, const Layout& layout, ChannelFile* file) {
  std::vector<std::string_view> names, unit;
  std::size_t preamble = layout.first;
  const auto fits = [&](std::size_t row, std::vector<std::string_view>* cells) {
    split(lines[row].text, layout.style.separator, cells);
    while (cells->size() > layout.columns && cells->back().empty()) cells->pop_back();
    return cells->size() == layout.columns;
  };
  if (layout.first > 0 && fits(layout.first - 1, &names)) {
    --preamble;
    if (isUnitRow(names) && preamble > 0 && fits(preamble - 1, &unit)) {
      std::swap(names, unit);
      --preamble;
    }
  } else {
    names.clear();
    if (layout.first > 0)
      file->notes.push_back("line " + std::to_string(lines[layout.first - 1].number) +
                            ": not a row of names for " + std::to_string(layout.columns) +
                            " columns; they are named by number");
  }
  for (std::size_t c = 0; c < layout.columns; ++c) {
    FileChannel channel;
    channel.name = names.empty() || names[c].empty() ? std::to_string(c + 1) : std::string(names[c]);
    if (!unit.empty() && unit[c] != "-") {
      std::string_view symbol = unit[c];
      if (symbol.size() > 2 && std::string_view("[({<").find(symbol.front()) != std::string_view::npos)
        symbol = symbol.substr(1, symbol.size() - 2);
      channel.unit = std::string(withoutBlanks(symbol));
    }
    file->channels.push_back(std::move(channel));
  }
  for (std::size_t i = 0; i < preamble; ++i) readRate(lines[i].text, layout.style, file);
}

}  // namespace

ChannelFile readTextTable(const std::string& file) {
  std::vector<Line> head;
  {
    CsvReader reader(file, '\t');
    std::string_view line;
    while (head.size() < MOST_PREAMBLE + LEAST_ROWS && reader.nextLine(&line)) {
      if (!line.empty()) head.push_back({reader.line(), std::string(line)});
    }
  }
  const Layout layout = layoutOf(head);
  if (layout.columns == 0)
    throw Error(file +
                ": no rows of numbers found; expected columns separated by comma, semicolon, tab or blanks");
  ChannelFile result;
  result.file = file;
  result.kind = "text";
  readHeader(head, layout, &result);
  std::set<std::string_view> names;
  for (const FileChannel& channel : result.channels) {
    if (!names.insert(channel.name).second)
      throw Error(file + ": two columns are named '" + channel.name + "'");
  }
  CsvReader reader(file, '\t');
  std::string_view line;
  std::vector<std::string_view> cells;
  std::string buffer;
  while (reader.nextLine(&line)) {
    if (reader.line() < head[layout.first].number) continue;
    if (line.empty()) {
      if (reader.restIsBlank()) break;
      reader.fail("is empty");
    }
    split(line, layout.style.separator, &cells);
    if (cells.size() > layout.columns) dropEmptyLast(&cells);
    if (cells.size() != layout.columns)
      reader.fail(std::to_string(cells.size()) + " values, " + std::to_string(layout.columns) + " expected");
    for (std::size_t c = 0; c < cells.size(); ++c)
      result.channels[c].values.push_back(
          reader.number(withPoint(cells[c], layout.style, &buffer), result.channels[c].name));
  }
  return result;
}

}  // namespace smartmill::recording
