#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::report {

/// Agreement of the numbers of two sources.
struct Agreement {
  std::size_t compared = 0;
  std::size_t missing = 0;  ///< numbers in one source only
  double largest = 0.0;     ///< [1] largest difference over the largest number of its series
  /// @param tolerance [1] half a unit of the last digit printed
  /// @param most_missing [1] tolerated share, of the compared numbers, in one source only
  bool same(double tolerance, double most_missing = 0.0) const {
    return compared > 0 && static_cast<double>(missing) <= most_missing * static_cast<double>(compared) &&
           largest <= tolerance;
  }

  /// Adds a series of one quantity: differences are relative to its largest number. NaN and infinity must be
  /// in both sources.
  void add(const std::vector<double>& live, const std::vector<double>& offline);
};

}  // namespace smartmill::report
