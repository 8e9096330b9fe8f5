#include "smartmill_kalman/sensor/numeric_table.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "smartmill_core/error.h"

namespace smartmill::kalman {
namespace {

std::vector<std::string> cellsOf(std::string line) {
  if (!line.empty() && line.back() == '\r') line.pop_back();
  std::vector<std::string> cells;
  std::stringstream cut(line);
  for (std::string cell; std::getline(cut, cell, ',');) cells.push_back(cell);
  return cells;
}

}  // namespace

std::vector<std::vector<double>> readNumericTable(const std::string& file,
                                                  const std::vector<std::string>& due) {
  std::ifstream stream(file);
  if (!stream) throw Error(file + ": cannot be read");
  std::string line;
  std::getline(stream, line);
  const std::vector<std::string> header = cellsOf(line);
  std::vector<std::size_t> place;
  for (const std::string& name : due) {
    const auto at = std::find(header.begin(), header.end(), name);
    if (at == header.end()) throw Error(file + ": column " + name + " is missing");
    place.push_back(static_cast<std::size_t>(at - header.begin()));
  }
  std::vector<std::vector<double>> columns(due.size());
  for (int number = 2; std::getline(stream, line); ++number) {
    const std::vector<std::string> cells = cellsOf(line);
    if (cells.empty()) continue;
    for (std::size_t c = 0; c < due.size(); ++c) {
      const std::string cell = place[c] < cells.size() ? cells[place[c]] : "";
      char* end = nullptr;
      const double value = std::strtod(cell.c_str(), &end);
      if (cell.empty() || *end != '\0' || !std::isfinite(value)) {
        throw Error(file + ": line " + std::to_string(number) + ": column " + due[c] + ": '" + cell +
                    "' is no number");
      }
      columns[c].push_back(value);
    }
  }
  if (columns.empty() || columns.front().empty()) throw Error(file + ": no rows");
  return columns;
}

}  // namespace smartmill::kalman
