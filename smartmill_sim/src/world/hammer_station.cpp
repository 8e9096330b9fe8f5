#include "smartmill_sim/world/hammer_station.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

// In front of a sensor: not beside it, not above it, not far from it.
constexpr double BESIDE = 2e-3;  // [m]
constexpr double ABOVE = 30e-3;  // [m]
constexpr double FAR = 4e-3;     // [m]
// Flanks of a flute seen by the sensor, either side of the edge.
constexpr double RAKE_FLANK = 0.25, RELIEF_FLANK = 0.35;  // [rad]

}  // namespace

double Blow::force(double time) const {
  const double u = time - begin;
  return u > 0.0 && u < contact ? peak * std::sin(units::PI * u / contact) : 0.0;
}

HammerStation::HammerStation(const smartmill::HammerStation& station, const ToolGeometry& tool,
                             std::optional<double> stickout)
    : station_(station), tool_(tool) {
  if (!stickout) return;
  const double whole = *stickout, l = whole - station.offset;
  if (!(l > 0.0)) {
    throw Error("hammer.offset_mm: " + std::to_string(station.offset / units::MM) +
                " is not below the tool's stickout");
  }
  shape_ = l * l * (3.0 * whole - l) / (2.0 * whole * whole * whole);
}

std::optional<std::size_t> HammerStation::facing(const std::array<double, 3>& position) const {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto found = station_.position.find(axis == 0 ? "x" : "y");
    if (found == station_.position.end()) continue;
    const Axes3& p = found->second;
    if (std::abs(position[1 - axis] - p[1 - axis]) < BESIDE && std::abs(position[2] - p[2]) < ABOVE &&
        std::abs(p[axis] - position[axis]) < FAR) {
      return axis;
    }
  }
  return std::nullopt;
}

/// [m] how far the surface that faces the sensor lies behind the cutting circle.
double HammerStation::retreat(double angle, double facing) const {
  double least = station_.flute_depth;
  for (int tooth = 0; tooth < tool_.teeth; ++tooth) {
    const double off = std::remainder(angle + tool_.toothAngle(tooth) - facing, units::TWO_PI);
    const double width = off > 0.0 ? RAKE_FLANK : RELIEF_FLANK;
    least = std::min(least, -station_.flute_depth * std::expm1(-off * off / (width * width)));
  }
  return least;
}

double HammerStation::voltage(const std::array<double, 3>& position, double angle,
                              const std::array<double, 2>& displacement) const {
  const std::optional<std::size_t> axis = facing(position);
  if (!axis) return -station_.range_volt;
  const Axes3& p = station_.position.at(*axis == 0 ? "x" : "y");
  // A lower tool shows the sensor a higher point of its edges, which lags.
  const double lag = tool_.lag() * (p[2] - position[2]);
  const double gap = p[*axis] + 2.0 * station_.gap_at_zero_volt - position[*axis] - displacement[*axis] +
                     retreat(angle - lag, *axis == 0 ? 0.5 * units::PI : 0.0);
  if (gap <= 0.0) return station_.range_volt;
  return clipped(station_.gain_volt * (station_.gap_at_zero_volt / gap - 1.0));
}

double HammerStation::clipped(double voltage) const {
  return std::clamp(voltage, -station_.range_volt, station_.range_volt);
}

}  // namespace smartmill::sim
