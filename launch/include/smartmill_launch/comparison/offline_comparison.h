#pragma once

#include <cstddef>
#include <vector>

namespace smartmill::report {

/// How far the numbers of two sources part.
struct Agreement {
  std::size_t compared = 0;
  std::size_t missing = 0;  ///< numbers that only one of them has
  double largest = 0.0;     ///< [1] largest difference over the largest number of its series
  /// @param tolerance [1] half a unit of the last digit printed
  /// @param most_missing [1] of what was compared may be on one side only
  bool same(double tolerance, double most_missing = 0.0) const {
    return compared > 0 && static_cast<double>(missing) <= most_missing * static_cast<double>(compared) &&
           largest <= tolerance;
  }

  /// A series whose numbers are of one kind: differences count against its largest number. NaN and infinity
  /// must stand on both sides.
  void add(const std::vector<double>& live, const std::vector<double>& offline);
};

}  // namespace smartmill::report
