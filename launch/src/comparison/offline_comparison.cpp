#include "smartmill_launch/comparison/offline_comparison.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "smartmill_core/error.h"

namespace smartmill::report {
namespace {

std::vector<std::string> cellsOf(const std::string& line) {
  std::vector<std::string> cells;
  std::size_t begin = 0;
  for (std::size_t comma; (comma = line.find(',', begin)) != std::string::npos; begin = comma + 1) {
    cells.push_back(line.substr(begin, comma - begin));
  }
  cells.push_back(line.substr(begin));
  return cells;
}

}  // namespace

const std::vector<double>& NumberTable::column(const std::string& name) const {
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i].substr(0, names[i].find('[')) == name) return columns[i];
  }
  throw Error("column " + name + " is missing");
}

NumberTable readNumberTable(const std::string& file) {
  std::ifstream in(file);
  if (!in) throw Error(file + ": cannot be read");
  NumberTable table;
  std::string line;
  std::getline(in, line);
  table.names = cellsOf(line);
  table.columns.resize(table.names.size());
  for (std::size_t number = 2; std::getline(in, line); ++number) {
    const std::vector<std::string> cells = cellsOf(line);
    if (cells.size() != table.names.size()) {
      throw Error(file + ":" + std::to_string(number) + ": " + std::to_string(cells.size()) + " cells, " +
                  std::to_string(table.names.size()) + " are due");
    }
    for (std::size_t i = 0; i < cells.size(); ++i) {
      char* end = nullptr;
      const double value = std::strtod(cells[i].c_str(), &end);
      if (*end != '\0')
        throw Error(file + ":" + std::to_string(number) + ": '" + cells[i] + "' is no number");
      table.columns[i].push_back(cells[i].empty() ? std::numeric_limits<double>::quiet_NaN() : value);
    }
  }
  return table;
}

void Agreement::add(const std::vector<double>& live, const std::vector<double>& offline) {
  const std::size_t common = std::min(live.size(), offline.size());
  missing += std::max(live.size(), offline.size()) - common;
  double scale = 0.0, difference = 0.0;
  for (std::size_t i = 0; i < common; ++i) {
    const bool numbers = std::isfinite(live[i]) && std::isfinite(offline[i]);
    if (!numbers) {
      if (std::isfinite(live[i]) != std::isfinite(offline[i])) ++missing;
      continue;
    }
    ++compared;
    scale = std::max(scale, std::abs(live[i]));
    difference = std::max(difference, std::abs(live[i] - offline[i]));
  }
  if (difference > 0.0) {
    largest = std::max(largest, scale > 0.0 ? difference / scale : std::numeric_limits<double>::infinity());
  }
}

}  // namespace smartmill::report
