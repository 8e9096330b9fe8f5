#include "smartmill_core/signal/angle_track.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill {

void AngleTrack::push(const SpindleAngle& reading) {
  if (!readings_.empty() && reading.stamp <= readings_.back().stamp) {
    if (reading.stamp > readings_.back().stamp - HISTORY) return;  // late or duplicate
    readings_.clear();
  }
  readings_.push_back(reading);
  while (readings_.front().stamp < reading.stamp - HISTORY) readings_.pop_front();
}

std::optional<double> AngleTrack::at(double time) const {
  if (readings_.empty()) return {};
  const auto after = std::lower_bound(readings_.begin(), readings_.end(), time,
                                      [](const SpindleAngle& r, double t) { return r.stamp < t; });
  const SpindleAngle& near = after == readings_.begin() ? *after : *(after - 1);
  if (std::isnan(near.angle)) return {};  // at rest
  const double since = time - near.stamp;
  if (std::abs(since) > REACH) return {};
  double turned = near.speed * since;
  if (after != readings_.end() && after != readings_.begin() && after->stamp - near.stamp <= REACH &&
      !std::isnan(after->angle)) {
    // The number of revolutions between two readings follows from the speed.
    const double between = after->stamp - near.stamp;
    const double predicted = 0.5 * (near.speed + after->speed) * between;
    const double measured = after->angle - near.angle;
    const double turns = std::round((predicted - measured) / units::TWO_PI);
    turned = (measured + turns * units::TWO_PI) * since / between;
  }
  return wrapped(near.angle + turned);
}

}  // namespace smartmill
