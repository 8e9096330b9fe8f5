#include "smartmill_kalman/compensation/gain_schedule.h"

#include <climits>
#include <cmath>

#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {
namespace {

/// Relative spacing of the grid. The gains serve up to HYSTERESIS spacings from their own speed, so that a
/// speed halfway between two points does not switch gains at every block.
constexpr double SPACING = 0.01, HYSTERESIS = 0.7;
/// Relative shift of a mode's frequency that the gains tolerate.
constexpr double FREQUENCY_TOLERANCE = 0.01;

}  // namespace

int GainSchedule::gridPointOf(double speed) {
  return static_cast<int>(std::lround(std::log(speed) / SPACING));
}

bool GainSchedule::covers(int grid_point, double speed) {
  return !(std::abs(std::log(speed) / SPACING - grid_point) > HYSTERESIS);
}

const std::vector<HarmonicGain>& GainSchedule::gains(std::size_t axis, const SensorAxis& sensor,
                                                     int grid_point, double sample_rate) {
  if (sample_rate_ != sample_rate) clear();
  sample_rate_ = sample_rate;
  std::vector<HarmonicGain>& gains = gains_[{axis, grid_point}];
  if (gains.empty()) {
    HarmonicFilterParameters parameters = parameters_;
    parameters.noise_rms = sensor.noise_rms;
    design_frequencies_[axis].clear();
    for (const Mode& mode : sensor.model.modes) design_frequencies_[axis].push_back(mode.frequency);
    gains = designGains(sensor.model, std::exp(grid_point * SPACING), sample_rate, parameters);
  }
  return gains;
}

bool GainSchedule::suits(std::size_t axis, const ModalModel& sensor) const {
  const std::vector<double>& designed = design_frequencies_[axis];
  if (designed.size() != sensor.modes.size()) return false;
  for (std::size_t k = 0; k < designed.size(); ++k) {
    if (std::abs(sensor.modes[k].frequency / designed[k] - 1.0) > FREQUENCY_TOLERANCE) return false;
  }
  return true;
}

void GainSchedule::clear(std::size_t axis) {
  gains_.erase(gains_.lower_bound({axis, INT_MIN}), gains_.upper_bound({axis, INT_MAX}));
}

}  // namespace smartmill::kalman
