#include "smartmill_kalman/following/harmonic_speed_tracker.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::kalman {
HarmonicSpeedTracker::HarmonicSpeedTracker(const SpeedTrackerParameters& tracker,
                                           const HarmonicFilterParameters& filter, double speed,
                                           double sample_rate)
    : limits_(tracker),
      tracker_(tracker, speed, sample_rate),
      filter_(filter),
      sample_rate_(sample_rate),
      speed_used_(speed) {
}

void HarmonicSpeedTracker::prepare(const std::vector<HarmonicFilter>& filters, double speed) {
  speed_used_ = speed;
  const std::size_t level =
      std::min({filters[0].memory().level(), filters[1].memory().level(), filters[2].memory().level()});
  memory_ = filter_.memory(level) * units::TWO_PI / speed;
  const double highest = std::max(limits_.min_harmonics, limits_.max_shift * speed / tracker_.speedStd());
  // Root of the sum of n^2: noise of equal harmonics in the slope.
  const double n = std::min(highest, static_cast<double>(filters.front().pairs().harmonics()));
  slope_gain_ = std::sqrt(n * (n + 1.0) * (2.0 * n + 1.0) / 6.0);
  for (std::size_t axis = 0; axis < 3; ++axis) slope_[axis] = filters[axis].pairs().slope(highest);
}

void HarmonicSpeedTracker::update(const std::vector<HarmonicFilter>& filters,
                                  const std::array<double, 3>& noise_rms) {
  std::size_t restarts = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    tracker_.update(axis, filters[axis].innovation(), slope_[axis], noise_rms[axis],
                    noise_rms[axis] * slope_gain_ / std::sqrt(memory_ * sample_rate_));
    restarts += filters[axis].memory().restarts();
  }
  tracker_.predict(speed_used_, memory_);
  if (restarts != restarts_) tracker_.resetCovariance();
  restarts_ = restarts;
}

}  // namespace smartmill::kalman
