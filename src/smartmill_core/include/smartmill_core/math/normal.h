#pragma once

#include <cmath>

namespace smartmill {

/// [1] Probability that a standard normal variable is below x; nan for nan.
inline double normalCdf(double x) {
  return 0.5 * std::erfc(-x / std::sqrt(2.0));
}

}  // namespace smartmill
