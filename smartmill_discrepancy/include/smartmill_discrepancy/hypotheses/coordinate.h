#pragma once

#include <string>

namespace smartmill::discrepancy {

/// A number of the model that a fit may move.
struct Coordinate {
  std::string name;
  double null = 0.0;  ///< value that changes nothing (nominal: 0; prior mean)
  double low = 0.0, high = 0.0;
  double step = 0.0;       ///< of numeric tangents
  double prior_std = 0.0;  ///< Gaussian prior about null
};

}  // namespace smartmill::discrepancy
