#include "chart/size_limit.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "smartmill_core/signal/statistics.h"

namespace smartmill::stability {

SizeLimit::SizeLimit(const UncertainSystem& system, double tolerance, const RiskOptions& spread)
    : mean_(system.mean()), tolerance_(tolerance), margin_(spread.speed_margin) {
  std::mt19937_64 random(spread.seed);
  for (int i = 0; i < spread.draws; ++i) drawn_.emplace_back(system.draw(random));
}

std::vector<double> SizeLimit::speedsAbout(double speed) const {
  return {(1.0 - margin_) * speed, speed, (1.0 + margin_) * speed};
}

bool SizeLimit::meanHolds(double speed, double depth) const {
  const std::vector<double> speeds = speedsAbout(speed);
  return std::all_of(speeds.begin(), speeds.end(),
                     [&](double s) { return std::abs(mean_.at(s, depth).error) <= tolerance_; });
}

bool SizeLimit::holds(double speed, double depth) const {
  const std::vector<double> speeds = speedsAbout(speed);
  return std::all_of(speeds.begin(), speeds.end(), [&](double s) {
    return std::abs(mean_.at(s, depth).error) + 2.0 * errorStd(drawn_, s, depth) <= tolerance_;
  });
}

}  // namespace smartmill::stability
