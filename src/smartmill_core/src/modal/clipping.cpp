#include "clipping.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace smartmill {
namespace {

/// Band at the top in which samples are counted.
double widthOf(const HitChannel& c, const ClippingLimits& limits) {
  return std::max(limits.flat_noise * c.noise, limits.flat_share * c.largest);
}

/// Clipped before the converter, equal within the noise: a flat around the largest sample that ends in
/// corners. Next to a round crest, however broad, each step down is larger than the one before.
bool hasFlatTop(const HitChannel& c, double sign, const ClippingLimits& limits) {
  const auto n = static_cast<std::ptrdiff_t>(c.values.size());
  const auto at = [&](std::ptrdiff_t i) { return sign * c.values[static_cast<std::size_t>(i)]; };
  const double width = widthOf(c, limits);
  std::ptrdiff_t top = 0;
  for (std::ptrdiff_t i = 1; i < n; ++i) top = at(i) > at(top) ? i : top;
  std::ptrdiff_t ends[2] = {top, top};
  for (const int side : {0, 1}) {
    const std::ptrdiff_t direction = side == 0 ? -1 : 1;
    while (ends[side] + 4 * direction >= 0 && ends[side] + 4 * direction < n &&
           at(top) - at(ends[side] + direction) < width)
      ends[side] += direction;
  }
  const auto length = static_cast<double>(ends[1] - ends[0] + 1);
  if (length < limits.flat) return false;
  for (const int side : {0, 1}) {
    const std::ptrdiff_t direction = side == 0 ? -1 : 1, end = ends[side];
    if (end + 4 * direction < 0 || end + 4 * direction >= n) return false;
    const double second = at(end + direction) - at(end + 2 * direction),
                 third = at(end + 2 * direction) - at(end + 3 * direction);
    const double round = width * std::pow(1.0 + 4.0 / length, 2);  // fall of a parabola of this width
    const double fall = (at(top) - at(end + 2 * direction)) / round;
    if (fall < limits.sharp || (third > limits.round * second && fall < limits.very_sharp)) return false;
  }
  return true;
}

/// Many crests of equal height: a round crest has at most 1.4 times as many samples in a band at its top as
/// in the two below it.
bool hasEqualCrests(const HitChannel& c, double sign, const ClippingLimits& limits) {
  const double width = widthOf(c, limits);
  double top = 0.0;
  for (const double v : c.values) top = std::max(top, sign * v);
  std::size_t first = 0, next = 0;
  for (const double v : c.values) {
    const double depth = top - sign * v;
    first += depth < width;
    next += depth >= width && depth < 3.0 * width;
  }
  return top > 0.2 * c.largest && first >= limits.crowd && first >= limits.crowded * next;
}

/// Clipped on both sides: an amplifier has the same range in both directions, while the crests of a decay
/// fall from one to the next. Minimum and maximum have equal magnitude, and samples accumulate there.
bool clippedOnBothSides(const HitChannel& c, const ClippingLimits& limits) {
  const double width = widthOf(c, limits);
  const auto [low, high] = std::minmax_element(c.values.begin(), c.values.end());
  if (std::abs(*high + *low) >= width) return false;
  std::size_t first = 0, next = 0;
  for (const double v : c.values) {
    const double depth = c.largest - std::abs(v);
    first += depth < width;
    next += depth >= width && depth < 3.0 * width;
  }
  return first >= limits.mirrored && first >= limits.piled * next;
}

/// Number of samples equal to the largest value, of their crests, and of other samples near it.
struct Top {
  std::size_t equal = 0, below = 0, crests = 0;
};
Top topOf(const HitChannel& c, double sign, const ClippingLimits& limits) {
  double top = 0.0;
  for (const double v : c.values) top = std::max(top, sign * v);
  Top found;
  bool before = false;
  for (const double v : c.values) {
    const double depth = top - sign * v;
    const bool equal = depth <= 1e-9 * top;
    found.equal += equal;
    found.crests += equal && !before;
    found.below += !equal && depth < limits.top_share * top;
    before = equal;
  }
  return top < 0.2 * c.largest ? Top{} : found;
}

/// Resolution of the converter.
double stepOf(const std::vector<double>& values) {
  double step = INFINITY;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double d = std::abs(values[i] - values[i - 1]);
    if (d > 0.0) step = std::min(step, d);
  }
  return step;
}

}  // namespace

bool clipped(const HitChannel& c, bool both_ways, const ClippingLimits& limits) {
  const bool fine = stepOf(c.values) < limits.fine_step * c.largest;
  const Top up = topOf(c, 1.0, limits), down = both_ways ? topOf(c, -1.0, limits) : Top{};
  for (const Top& top : {up, down}) {
    if ((top.equal >= limits.equal && 2 * top.equal >= top.below) || (top.equal >= 2 && fine) ||
        (top.crests >= 2 && top.equal >= top.below))
      return true;
  }
  if ((up.equal >= 2 && down.equal >= 2) || hasFlatTop(c, 1.0, limits)) return true;
  return both_ways && (hasFlatTop(c, -1.0, limits) || hasEqualCrests(c, 1.0, limits) ||
                       hasEqualCrests(c, -1.0, limits) || clippedOnBothSides(c, limits));
}

}  // namespace smartmill
