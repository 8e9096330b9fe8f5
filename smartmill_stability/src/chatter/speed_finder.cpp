#include "chatter/speed_finder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "chatter/order_powers.h"
#include "smartmill_core/signal/spectral_lines.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double STRONG = 30.0;  // [1] power of a line over the floor; noise exceeds 14 in one of 16,000
constexpr double HIGHEST_LEVEL =
    3.4;                            // [1] of a line 30 times above the floor: a stronger one proves no more
constexpr double OF_SPINDLE = 2.0;  // [1] weight of all harmonics
constexpr double RESOLVED = 6.0;    // [lines] least distance of harmonics: main lobe of the window
constexpr std::size_t CELLS = 4;    // in a line
constexpr double TOLERANCE = 0.6;   // [lines] error of the frequency of a line and wander of the speed
constexpr double SAME_LINE = 2.0;   // [lines]
constexpr int COMPANIONS = 3;       // [revolutions or tooth passings] to each side
constexpr std::size_t MOST_STRONG = 8;

/// Sum of deviations from chance.
struct Comb {
  double sum = 0.0;
  std::size_t lines = 0;
  void add(double level, double mean) {
    if (std::isnan(level)) return;
    sum += level - mean;
    ++lines;
  }
  double deviations(double deviation) const {
    return lines > 0 ? sum / (deviation * std::sqrt(static_cast<double>(lines))) : 0.0;
  }
};

}  // namespace

SpeedFinder::SpeedFinder(const std::vector<double>& power, double step, double lowest, int teeth)
    : step_(step), lowest_(lowest), teeth_(teeth), power_(power), floor_(noiseFloor(power)) {
  level_.assign(CELLS * power.size(), 0.0);
  std::vector<std::pair<double, double>> peaks;  // power and [Hz]
  for (std::size_t k = 1; k + 1 < power.size(); ++k) {
    if (power[k] < power[k - 1] || power[k] <= power[k + 1]) continue;
    const double position = peakPosition(power, k);
    if (power[k] > STRONG * floor_[k]) peaks.emplace_back(power[k], position * step_);
    const double level = std::min(HIGHEST_LEVEL, std::log1p(power[k] / floor_[k]));
    const auto from = static_cast<std::size_t>((position - TOLERANCE) * CELLS + 0.5),
               to = static_cast<std::size_t>((position + TOLERANCE) * CELLS + 0.5);
    for (std::size_t cell = from; cell <= to && cell < level_.size(); ++cell)
      level_[cell] = std::max(level_[cell], level);
  }
  const auto low = std::min(level_.size(), static_cast<std::size_t>(lowest_ / step_ * CELLS));
  const std::vector<double> band(level_.begin() + static_cast<std::ptrdiff_t>(low), level_.end());
  if (band.empty()) return;
  mean_ = std::accumulate(band.begin(), band.end(), 0.0) / static_cast<double>(band.size());
  deviation_ = std::max(1e-9, standardDeviation(band));
  std::sort(peaks.rbegin(), peaks.rend());
  for (std::size_t i = 0; i < std::min(MOST_STRONG, peaks.size()); ++i) strong_.push_back(peaks[i].second);
}

double SpeedFinder::lowestSpeed() const {
  return units::TWO_PI * RESOLVED * step_;
}

double SpeedFinder::highestSpeed() const {
  return units::TWO_PI * step_ * static_cast<double>(power_.size()) / (3.0 * teeth_);
}

double SpeedFinder::levelAt(double frequency) const {
  const double at = std::abs(frequency);
  const auto k = static_cast<std::size_t>(std::lround(at / step_ * CELLS));
  if (at < lowest_ || k >= level_.size()) return std::numeric_limits<double>::quiet_NaN();
  return level_[k];
}

/// [Hz] Strongest line that is no multiple of a frequency; NaN without one.
double SpeedFinder::strongestBetween(double frequency) const {
  for (const double line : strong_)
    if (std::abs(std::remainder(line, frequency)) > SAME_LINE * step_) return line;
  return std::numeric_limits<double>::quiet_NaN();
}

double SpeedFinder::agreement(double speed) const {
  const double spindle = speed / units::TWO_PI, end = step_ * static_cast<double>(power_.size());
  const double between = strongestBetween(spindle);
  Comb of_teeth, of_spindle;
  for (int k = 1; k * spindle < end && k <= COMPARED_PASSINGS * teeth_; ++k) {
    const double level = levelAt(k * spindle);
    of_spindle.add(level, mean_);
    if (k % teeth_ == 0) of_teeth.add(level, mean_);
  }
  for (int k = -COMPANIONS; std::isfinite(between) && k <= COMPANIONS; ++k) {
    if (k == 0) continue;
    of_spindle.add(levelAt(between + k * spindle), mean_);
    of_teeth.add(levelAt(between + k * teeth_ * spindle), mean_);
  }
  return of_teeth.deviations(deviation_) + OF_SPINDLE * of_spindle.deviations(deviation_);
}

double SpeedFinder::best(double low, double high) const {
  // A step moves the highest harmonic of a speed by a cell, at most.
  const double ratio = 1.0 + 1.0 / static_cast<double>(level_.size());
  double best = low, agreed = -std::numeric_limits<double>::infinity();
  for (double speed = low; speed <= high; speed *= ratio) {
    const double here = agreement(speed);
    if (!(here > agreed)) continue;
    agreed = here;
    best = speed;
  }
  return refined(best);
}

/// [1] Deviation from chance of the multiples of a frequency [Hz] that are no multiples of `factor` times it.
double SpeedFinder::between(double frequency, int factor) const {
  Comb comb;
  for (int k = 1; k <= COMPARED_PASSINGS * factor * teeth_; ++k)
    if (k % factor != 0) comb.add(levelAt(k * frequency), mean_);
  return comb.deviations(deviation_);
}

bool SpeedFinder::teethDominate(double speed) const {
  const OrderPowers powers = orderPowers(teeth_, [&](int order) {
    const double frequency = order * speed / units::TWO_PI;
    const auto k = static_cast<std::size_t>(std::lround(frequency / step_));
    if (frequency < lowest_ || k + 1 >= power_.size()) return 0.0;
    const double most = std::max({power_[k - 1], power_[k], power_[k + 1]});
    return most > STRONG * floor_[k] ? most : 0.0;
  });
  return powers.teeth > powers.others;
}

double SpeedFinder::anywhere() const {
  constexpr double PRESENT = 3.0;  // [1] deviation from chance
  double speed = best(lowestSpeed(), highestSpeed());
  for (const int factor : {2, 3})
    while (speed * factor < highestSpeed() && between(speed / units::TWO_PI, factor) < PRESENT)
      speed *= factor;
  for (const int factor : {2, 3})
    while (speed / factor > lowestSpeed() && between(speed / factor / units::TWO_PI, factor) > PRESENT)
      speed /= factor;
  return refined(speed);
}

/// Least-squares speed through the frequencies of the harmonics that are strong lines.
double SpeedFinder::refined(double speed) const {
  const double spindle = speed / units::TWO_PI;
  const auto reach = static_cast<std::size_t>(SAME_LINE);
  double of_orders = 0.0, squares = 0.0;
  for (int order = 1; order <= COMPARED_PASSINGS * teeth_; ++order) {
    const auto center = static_cast<std::size_t>(std::lround(order * spindle / step_));
    if (center <= reach || center + reach + 1 >= power_.size() || order * spindle < lowest_) continue;
    const auto from = power_.begin() + static_cast<std::ptrdiff_t>(center - reach);
    const auto peak = std::max_element(from, from + static_cast<std::ptrdiff_t>(2 * reach + 1));
    const auto at = static_cast<std::size_t>(peak - power_.begin());
    const bool is_line = *peak > STRONG * floor_[at] && *peak > power_[at - 1] && *peak > power_[at + 1];
    if (!is_line) continue;
    of_orders += order * peakPosition(power_, at) * step_;
    squares += order * order;
  }
  return squares > 0.0 ? units::TWO_PI * of_orders / squares : speed;
}

}  // namespace smartmill::stability
