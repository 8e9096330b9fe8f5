#include "smartmill_core/signal/spectral_lines.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmill {

double peakPosition(const std::vector<double>& power, std::size_t peak) {
  const double a = std::log(power[peak - 1] + 1e-300), b = std::log(power[peak] + 1e-300),
               c = std::log(power[peak + 1] + 1e-300);
  const double curve = a - 2.0 * b + c;
  const double shift = curve < 0.0 ? std::clamp(0.5 * (a - c) / curve, -0.5, 0.5) : 0.0;
  return static_cast<double>(peak) + shift;
}

std::vector<double> noiseFloor(const std::vector<double>& power, std::size_t reach) {
  constexpr std::size_t STRIDE = 4;  // [lines] with the same floor; saves time
  std::vector<double> floor(power.size()), near;
  for (std::size_t k = 0; k < power.size(); k += STRIDE) {
    const std::size_t from = k > reach ? k - reach : 0, to = std::min(power.size(), k + reach);
    near.assign(power.begin() + static_cast<std::ptrdiff_t>(from),
                power.begin() + static_cast<std::ptrdiff_t>(to));
    const auto middle = near.begin() + static_cast<std::ptrdiff_t>(near.size() / 2);
    std::nth_element(near.begin(), middle, near.end());
    std::fill(floor.begin() + static_cast<std::ptrdiff_t>(k),
              floor.begin() + static_cast<std::ptrdiff_t>(std::min(k + STRIDE, power.size())),
              std::max(*middle, std::numeric_limits<double>::min()));
  }
  return floor;
}

}  // namespace smartmill
