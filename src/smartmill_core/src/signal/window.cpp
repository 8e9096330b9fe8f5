#include "smartmill_core/signal/window.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

/// Fraction of the peak from which the hammer counts as in contact (Dunwoody 4.3.1).
constexpr double SHOULDER_LEVEL = 0.1;

struct Shoulders {
  std::size_t peak;
  double before, after;  // [samples]
};

Shoulders findShoulders(const std::vector<double>& force) {
  const auto top = std::max_element(force.begin(), force.end());
  if (top == force.end() || !(*top > 0.0) || !std::isfinite(*top)) {
    throw Error("impact window: the force of " + std::to_string(force.size()) +
                " samples has no positive peak");
  }
  const auto peak = static_cast<std::size_t>(top - force.begin());
  const double level = SHOULDER_LEVEL * *top;
  std::size_t first = peak, last = peak;
  while (first > 0 && force[first] > level) {
    --first;
  }
  while (last + 1 < force.size() && force[last] > level) {
    ++last;
  }
  // A hit at the edge of the record has no shoulder there; one sample keeps the taper defined.
  return {peak, std::max(1.0, static_cast<double>(peak - first)),
          std::max(1.0, static_cast<double>(last - peak))};
}

double taper(double distance, double shoulder) {
  const double beyond = distance - 1.5 * shoulder;
  if (beyond <= 0.0) {
    return 1.0;
  }
  return beyond < shoulder ? 0.5 * (std::cos(units::PI * beyond / shoulder) + 1.0) : 0.0;
}

}  // namespace

double blackmanHarris(double turn) {
  return 0.35875 - 0.48829 * std::cos(turn) + 0.14128 * std::cos(2.0 * turn) - 0.01168 * std::cos(3.0 * turn);
}

std::vector<double> hannWindow(std::size_t n) {
  std::vector<double> window(n);
  for (std::size_t i = 0; i < n; ++i) {
    window[i] = 0.5 - 0.5 * std::cos(units::TWO_PI * static_cast<double>(i) / static_cast<double>(n));
  }
  return window;
}

std::vector<double> impactWindow(const std::vector<double>& force) {
  const Shoulders shoulders = findShoulders(force);
  std::vector<double> window(force.size());
  for (std::size_t i = 0; i < window.size(); ++i) {
    window[i] = i < shoulders.peak ? taper(static_cast<double>(shoulders.peak - i), shoulders.before)
                                   : taper(static_cast<double>(i - shoulders.peak), shoulders.after);
  }
  return window;
}

bool hasSecondHit(const std::vector<double>& force, double share) {
  const std::vector<double> window = impactWindow(force);
  const double level = share * *std::max_element(force.begin(), force.end());
  for (std::size_t i = 0; i < force.size(); ++i) {
    if (window[i] == 0.0 && force[i] > level) {
      return true;
    }
  }
  return false;
}

}  // namespace smartmill
