#pragma once

#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include "smartmill_stability/solvers/solver.h"
#include "smartmill_stability_testing/benchmark.h"

namespace smartmill::stability {

/// The benchmark of the oracles: two straight teeth, one mode in x or the same mode in x and y.
/// @param immersion [1] radial depth over diameter
inline RegenerativeSystem benchmarkSystem(double immersion, bool down, bool two_axes) {
  RegenerativeSystem system;
  system.modes = two_axes ? systemModes(benchmark(), benchmark()) : systemModes(benchmark(), 0);
  system.teeth = 2;
  system.diameter = 0.02;
  system.kt = 6e8;
  system.kr = 2e8;
  const double arc = std::acos(1.0 - 2.0 * immersion);
  system.entry = down ? units::PI - arc : 0.0;
  system.exit = down ? units::PI : arc;
  return system;
}

struct OracleRow {
  double immersion, rpm, limit_mm;  ///< +inf: stable to 10 mm
  bool down;
};

/// Rows of a file in the format of oracles/insperger_1dof_first_limit.csv.
inline std::vector<OracleRow> oracleRows(const std::string& name) {
  std::ifstream file(name);
  std::vector<OracleRow> rows;
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream fields(line);
    std::string immersion, milling, rpm, limit;
    std::getline(fields, immersion, ',');
    std::getline(fields, milling, ',');
    std::getline(fields, rpm, ',');
    std::getline(fields, limit, ',');
    const bool stable = limit.find_first_of("0123456789") == std::string::npos;
    rows.push_back({std::stod(immersion), std::stod(rpm),
                    stable ? std::numeric_limits<double>::infinity() : std::stod(limit), milling == "down"});
  }
  return rows;
}

}  // namespace smartmill::stability
