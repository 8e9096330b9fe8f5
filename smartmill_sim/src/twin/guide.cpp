#include "smartmill_sim/twin/guide.h"

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
std::vector<double> pushed(const std::vector<double>& shown, const ModalModel& sensor, const ModalModel& tip,
                           double sign, double sample_rate) {
  constexpr double LEAST_ANSWER = 0.05;  // [1] relative to the static gain
  constexpr double RINGING = 0.2;        // [s] zero padding against the circular convolution
  std::vector<double> padded = shown;
  padded.resize(shown.size() + static_cast<std::size_t>(RINGING * sample_rate), 0.0);
  std::vector<std::complex<double>> spectrum = fourier(padded);
  const std::vector<double> frequency = fourierFrequencies(padded.size(), sample_rate);
  for (std::size_t k = 0; k < spectrum.size(); ++k) {
    const std::complex<double> answer = sensor.modes.empty() ? 1.0 : sensor.response(frequency[k]);
    const double square = std::max(std::norm(answer), LEAST_ANSWER * LEAST_ANSWER);
    spectrum[k] *= sign * std::conj(answer) / square * tip.response(frequency[k]);
  }
  std::vector<double> place = inverseFourier(spectrum, padded.size());
  place.resize(shown.size());
  return place;
}

// Samples i - 1 .. i + 2.
std::array<double, 4> about(const std::vector<double>& samples, std::size_t i) {
  const auto at = [&](std::ptrdiff_t k) {
    return samples[static_cast<std::size_t>(
        std::clamp<std::ptrdiff_t>(k, 0, static_cast<std::ptrdiff_t>(samples.size()) - 1))];
  };
  const auto k = static_cast<std::ptrdiff_t>(i);
  return {{at(k - 1), at(k), at(k + 1), at(k + 2)}};
}

}  // namespace

double interpolated(const std::vector<double>& samples, std::size_t i, double share) {
  const std::array<double, 4> s = about(samples, i);
  return catmullRom(s[0], s[1], s[2], s[3], share);
}

bool Guide::canBe(const Record& recorded) {
  return (recorded.has(TIP[0]) && recorded.has(TIP[1])) || byForce(recorded);
}

bool Guide::byForce(const Record& recorded) {
  return !(recorded.has(TIP[0]) && recorded.has(TIP[1])) && recorded.has(FORCE[0]) && recorded.has(FORCE[1]);
}

Guide::Guide(const MachineModel& model, const Record& recorded, double sample_rate)
    : sample_rate_(sample_rate) {
  const double sign = model.force_sensor.measures_workpiece ? -1.0 : 1.0;
  for (std::size_t a = 0; a < 2; ++a) {
    tip_[a] = byForce(recorded) ? pushed(recorded.column(FORCE[a]), model.force_sensor.axis[a],
                                         a == 0 ? model.tool_tip.x : model.tool_tip.y, sign, sample_rate)
                                : recorded.column(TIP[a]);
  }
}

TipPlace Guide::at(std::size_t i, double share) const {
  TipPlace place;
  for (std::size_t a = 0; a < 2; ++a) {
    const std::array<double, 4> s = about(tip_[a], i);
    place.displacement[a] = catmullRom(s[0], s[1], s[2], s[3], share);
    place.rate[a] = sample_rate_ * catmullRomSlope(s[0], s[1], s[2], s[3], share);
  }
  return place;
}

}  // namespace smartmill::sim
