#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/stability_chart.h"

namespace smartmill {

/// [rad/s] How far a cut's speed may fall and rise before its depth reaches the limit, with linear
/// interpolation between the chart's speeds. Up to the end of the chart where the limit is not reached; 0 for
/// a cut above the limit.
inline std::array<double, 2> lobeFlanks(const StabilityLimit& limit, double speed, double depth) {
  const std::vector<double>&s = limit.spindle_speed, &d = limit.depth;
  if (s.empty() || speed < s.front() || speed > s.back()) return {{0.0, 0.0}};
  std::size_t above = 0;
  while (above + 1 < s.size() && s[above] < speed) ++above;
  const std::size_t below = s[above] == speed || above == 0 ? above : above - 1;
  const auto between = [](double a, double b, double share) {
    return std::isfinite(a) && std::isfinite(b) ? a + share * (b - a) : std::max(a, b);
  };
  const double here =
      above == below ? d[above] : between(d[below], d[above], (speed - s[below]) / (s[above] - s[below]));
  if (!(here > depth)) return {{0.0, 0.0}};
  // From a speed whose limit is deeper to the next one.
  const auto room = [&](std::size_t next, int step) {
    double at = speed, deep = here;
    for (;; next = static_cast<std::size_t>(static_cast<long>(next) + step)) {
      if (!(d[next] > depth)) {
        const double share = std::isfinite(deep) ? (deep - depth) / (deep - d[next]) : 1.0;
        return std::abs(at + share * (s[next] - at) - speed);
      }
      at = s[next];
      deep = d[next];
      if (next == (step < 0 ? 0 : s.size() - 1)) return std::abs(at - speed);
    }
  };
  return {{room(below, -1), room(above, 1)}};
}

}  // namespace smartmill
