#include "chart/size_limit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace smartmill::stability {

SizeLimit::SizeLimit(const UncertainSystem& system, double tolerance, const RiskOptions& spread)
    : mean_(system.mean()), tolerance_(tolerance), margin_(spread.speed_margin) {
  std::mt19937_64 random(spread.seed);
  for (int i = 0; i < spread.draws; ++i) drawn_.emplace_back(system.draw(random));
}

/// @param deviations [1] standard deviations that are added to the error
bool SizeLimit::within(double speed, double depth, double deviations) const {
  const std::array<double, 3> speeds{{(1.0 - margin_) * speed, speed, (1.0 + margin_) * speed}};
  return std::all_of(speeds.begin(), speeds.end(), [&](double s) {
    const double spread = deviations > 0.0 ? deviations * errorStd(drawn_, s, depth) : 0.0;
    return std::abs(mean_.at(s, depth).error) + spread <= tolerance_;
  });
}

bool SizeLimit::meanHolds(double speed, double depth) const {
  return within(speed, depth, 0.0);
}

bool SizeLimit::holds(double speed, double depth) const {
  return within(speed, depth, 2.0);
}

}  // namespace smartmill::stability
