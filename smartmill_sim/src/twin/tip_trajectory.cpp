#include "smartmill_sim/twin/tip_trajectory.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/interpolate.h"

namespace smartmill::sim {
namespace {

const std::array<const char*, 2> TIP{{"tool_x", "tool_y"}}, FORCE{{"fx", "fy"}};

// Displacement [m] of the tip under the measured force [N]. The inverse of the sensor's FRF is regularised
// where its gain is small.
std::vector<double> displacementUnder(const std::vector<double>& measured, const ModalModel& sensor,
                                      const ModalModel& tip, double sign, double sample_rate,
                                      const SimulationOptions& options) {
  std::vector<double> padded = measured;
  padded.resize(measured.size() + static_cast<std::size_t>(options.ringing * sample_rate), 0.0);
  std::vector<std::complex<double>> spectrum = fourier(padded);
  const std::vector<double> frequency = fourierFrequencies(padded.size(), sample_rate);
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    const std::complex<double> gain = sensor.modes.empty() ? 1.0 : sensor.response(frequency[k]);
    const double square = std::max(std::norm(gain), options.least_sensor_gain * options.least_sensor_gain);
    spectrum[k] *= sign * std::conj(gain) / square * tip.response(frequency[k]);
  }
  std::vector<double> motion = inverseFourier(spectrum, padded.size());
  motion.resize(measured.size());
  return motion;
}

// Samples i - 1 .. i + 2.
std::array<double, 4> samplesAround(const std::vector<double>& samples, std::size_t i) {
  const auto at = [&](std::ptrdiff_t k) {
    return samples[static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(k, 0, static_cast<std::ptrdiff_t>(samples.size()) - 1))];
  };
  const auto k = static_cast<std::ptrdiff_t>(i);
  return {{at(k - 1), at(k), at(k + 1), at(k + 2)}};
}

}  // namespace

double interpolated(const std::vector<double>& samples, std::size_t i, double share) {
  const std::array<double, 4> s = samplesAround(samples, i);
  return catmullRom(s[0], s[1], s[2], s[3], share);
}

bool TipTrajectory::isAvailable(const Record& recorded) {
  return (recorded.has(TIP[0]) && recorded.has(TIP[1])) || isFromForce(recorded);
}

bool TipTrajectory::isFromForce(const Record& recorded) {
  return !(recorded.has(TIP[0]) && recorded.has(TIP[1])) && recorded.has(FORCE[0]) && recorded.has(FORCE[1]);
}

TipTrajectory::TipTrajectory(const MachineModel& model, const Record& recorded, double sample_rate,
                             const SimulationOptions& options)
    : sample_rate_(sample_rate) {
  const double sign = model.force_sensor.measures_workpiece ? -1.0 : 1.0;
  for (std::size_t a = 0; a < 2; ++a) {
    tip_[a] = isFromForce(recorded) ? displacementUnder(recorded.column(FORCE[a]), model.force_sensor.axis[a],
                                                        a == 0 ? model.tool_tip.x : model.tool_tip.y, sign,
                                                        sample_rate, options)
                                    : recorded.column(TIP[a]);
  }
}

TipMotion TipTrajectory::at(std::size_t i, double share) const {
  TipMotion motion;
  for (std::size_t a = 0; a < 2; ++a) {
    const std::array<double, 4> s = samplesAround(tip_[a], i);
    motion.displacement[a] = catmullRom(s[0], s[1], s[2], s[3], share);
    motion.rate[a] = sample_rate_ * catmullRomSlope(s[0], s[1], s[2], s[3], share);
  }
  return motion;
}

}  // namespace smartmill::sim
