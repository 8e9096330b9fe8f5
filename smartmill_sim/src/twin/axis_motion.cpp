#include "smartmill_sim/twin/axis_motion.h"

#include <algorithm>
#include <string>

#include "smartmill_core/campaign/record_columns.h"
#include "smartmill_core/signal/derivative.h"

namespace smartmill::sim {

bool AxisMotion::isRecorded(const Record& record) {
  return std::any_of(record.names.begin(), record.names.end(), motionAxis);
}

AxisMotion::AxisMotion(const Record& record, double sample_rate, double smoothing) {
  for (std::size_t a = 0; a < 3; ++a) {
    const std::string axis(1, "xyz"[a]), position = "axis_" + axis, velocity = "axis_v" + axis;
    if (record.has(velocity)) {
      acceleration_[a] = smoothedDerivative(record.column(velocity), sample_rate, 1, smoothing);
    } else if (record.has(position)) {
      acceleration_[a] = smoothedDerivative(record.column(position), sample_rate, 2, smoothing);
    }
  }
}

Axes3 AxisMotion::acceleration(std::size_t i, double share) const {
  Axes3 now{{0, 0, 0}};
  for (std::size_t a = 0; a < 3; ++a) {
    const std::vector<double>& samples = acceleration_[a];
    if (samples.empty()) continue;
    now[a] = samples[i] + share * (samples[std::min(i + 1, samples.size() - 1)] - samples[i]);
  }
  return now;
}

}  // namespace smartmill::sim
