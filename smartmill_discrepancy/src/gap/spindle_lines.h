#pragma once

#include <cstddef>
#include <vector>

#include "gap/orders.h"

namespace smartmill::discrepancy {

/// Reduction of squares by a sine with free phase, and its amplitudes.
struct Line {
  double squares = 0.0, sine = 0.0, cosine = 0.0;
};

/// Least squares of a sine and a cosine.
struct LineSums {
  double ss = 0.0, cc = 0.0, sc = 0.0, s = 0.0, c = 0.0;

  void add(double sine, double cosine, double value);
  Line solve() const;
};

/// Lines at orders of the spindle, each fitted separately. Sums that do not depend on the values are computed
/// once.
class SpindleLines {
 public:
  /// @param angle [rad] of each sample @param orders whole ones, from 1 @param half_orders 0.5, 1.5, ...
  SpindleLines(const std::vector<double>& angle, std::size_t orders, std::size_t half_orders);

  /// Of the whole orders.
  std::vector<Line> wholes(const std::vector<double>& values) const;
  /// Of the half orders.
  std::vector<Line> halves(const std::vector<double>& values) const;

 private:
  OrderBasis whole_, half_;
  std::vector<LineSums> wholes_, halves_;
};

}  // namespace smartmill::discrepancy
