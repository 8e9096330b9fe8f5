#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace smartmill::stability {

/// Values from low to high in equal ratios of at most 1 + step. @param low > 0, high > low
inline std::vector<double> geometricGrid(double low, double high, double step) {
  const auto count = static_cast<std::size_t>(std::ceil(std::log(high / low) / std::log1p(step))) + 1;
  std::vector<double> values;
  for (std::size_t k = 0; k < count; ++k)
    values.push_back(low * std::pow(high / low, static_cast<double>(k) / static_cast<double>(count - 1)));
  values.back() = high;
  return values;
}

}  // namespace smartmill::stability
