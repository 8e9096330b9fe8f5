#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_core/cutting/stability_chart.h"

namespace smartmill {

/// [rad/s] How far a cut's speed may fall and rise before its depth reaches the limit, by straight lines
/// between the chart's speeds; to the chart's end where it never does; 0 of a cut above the limit.
inline std::array<double, 2> lobeFlanks(const StabilityLimit& limit, double speed, double depth) {
  const std::vector<double>&s = limit.spindle_speed, &d = limit.depth;
  std::size_t above = 0;
  while (above < s.size() && s[above] <= speed) ++above;
  const auto crossing = [&](std::size_t from, std::size_t to) {
    if (!std::isfinite(d[from]) || !std::isfinite(d[to])) return s[to];
    return s[from] + (s[to] - s[from]) * (d[from] - depth) / (d[from] - d[to]);
  };
  std::array<double, 2> room{{0.0, 0.0}};
  if (s.empty()) return room;
  std::size_t k = above > 0 ? above - 1 : 0;
  if (!(d[k] > depth)) return room;
  while (k > 0 && d[k - 1] > depth) --k;
  room[0] = speed - (k > 0 ? crossing(k, k - 1) : s.front());
  k = std::min(above, s.size() - 1);
  if (!(d[k] > depth)) {
    room[1] = above > 0 ? crossing(above - 1, k) - speed : 0.0;
    return room;
  }
  while (k + 1 < s.size() && d[k + 1] > depth) ++k;
  room[1] = (k + 1 < s.size() ? crossing(k, k + 1) : s.back()) - speed;
  return room;
}

}  // namespace smartmill
