#include "smartmill_loadmeter/inspection/slot_deflection.h"

#include <cmath>
#include <complex>
#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

using Spectrum = std::vector<std::complex<double>>;

constexpr std::size_t ANGLES = 2048;  // of a revolution
constexpr int HEIGHTS = 16;           // over the depth

// Steady vibration across the feed over a revolution [m].
std::vector<double> vibration(Spectrum force, const ModalModel& across, double rotation) {
  for (std::size_t k = 0; k < force.size(); ++k)
    force[k] *= across.response(static_cast<double>(k) * rotation);
  return inverseFourier(force, ANGLES);
}

// Cyclic, linear between the angles.
double at(const std::vector<double>& series, double angle) {
  const double turns = angle / units::TWO_PI, place = (turns - std::floor(turns)) * ANGLES - 0.5;
  const double below = std::floor(place), share = place - below;
  const auto cyclic = [&](double i) { return series[(static_cast<std::size_t>(i + ANGLES)) % ANGLES]; };
  return (1.0 - share) * cyclic(below) + share * cyclic(below + 1.0);
}

}  // namespace

Estimate slotWidening(const CuttingCondition& cut, const CuttingCoefficients& coefficients,
                      double force_uncertainty, const ModalModel& across, const Uncertainty& uncertainty) {
  const MechanisticForce model(cut.tool, coefficients, cut.engagement);
  std::vector<double> force;
  for (std::size_t i = 0; i < ANGLES; ++i)
    force.push_back(model.at(units::TWO_PI * (static_cast<double>(i) + 0.5) / ANGLES).fy);
  const Spectrum spectrum = fourier(force);
  const double rotation = cut.spindle_speed / units::TWO_PI;  // [Hz]
  const double depth = cut.engagement.axial_depth, lag = cut.tool.lag();
  const auto widening = [&](const ModalModel& modes) {
    const std::vector<double> y = vibration(spectrum, modes, rotation);
    double sum = 0.0;
    for (int h = 0; h < HEIGHTS; ++h) {
      const double angle =
          lag * depth * (h + 0.5) / HEIGHTS;  // of the tip when the edge at this height is at 0
      sum += at(y, angle) - at(y, angle + units::PI);
    }
    return sum / HEIGHTS;
  };
  const double value = widening(across);
  ModalModel shifted = across, damped = across;
  for (Mode& mode : shifted.modes) mode.frequency *= 1.0 + 0.01 * uncertainty.frequency;
  for (Mode& mode : damped.modes) mode.damping_ratio *= 1.0 + 0.01 * uncertainty.damping;
  const double by_force = value * std::hypot(force_uncertainty, 0.01 * uncertainty.stiffness);
  return {value, std::hypot(by_force, widening(shifted) - value, widening(damped) - value)};
}

}  // namespace smartmill::loadmeter
