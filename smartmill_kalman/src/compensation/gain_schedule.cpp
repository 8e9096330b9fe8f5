#include "smartmill_kalman/compensation/gain_schedule.h"

#include <climits>
#include <cmath>

#include "smartmill_kalman/filter/harmonic_filter.h"

namespace smartmill::kalman {
int GainSchedule::gridPointOf(double speed) const {
  return static_cast<int>(std::lround(std::log(speed) / options_.spacing));
}

bool GainSchedule::covers(int grid_point, double speed) const {
  return !(std::abs(std::log(speed) / options_.spacing - grid_point) > options_.hysteresis);
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
    const double speed = std::exp(grid_point * options_.spacing);
    if (const auto memory = memory_.memory(axis, speed)) {
      parameters.uniform_noise = true;
      parameters.memory_revolutions = *memory;
    }
    gains = designGains(sensor.model, speed, sample_rate, parameters);
  }
  return gains;
}

void GainSchedule::setMemory(const MemorySchedule& memory) {
  memory_ = memory;
  clear();
}

bool GainSchedule::suits(std::size_t axis, const ModalModel& sensor) const {
  const std::vector<double>& designed = design_frequencies_[axis];
  if (designed.size() != sensor.modes.size()) return false;
  for (std::size_t k = 0; k < designed.size(); ++k) {
    if (std::abs(sensor.modes[k].frequency / designed[k] - 1.0) > options_.frequency_tolerance) return false;
  }
  return true;
}

void GainSchedule::clear(std::size_t axis) {
  gains_.erase(gains_.lower_bound({axis, INT_MIN}), gains_.upper_bound({axis, INT_MAX}));
}

}  // namespace smartmill::kalman
