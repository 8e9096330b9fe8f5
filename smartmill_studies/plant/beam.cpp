#include "plant/beam.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "plant/beam_element.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {
namespace {

constexpr int ELEMENTS = 12;

constexpr int SIZE = 2 * (ELEMENTS + 1);

NormalModes modesOf(const ToolInSpindle& t) {
  const int size = SIZE;
  Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(size, size), stiffness = mass;
  mass(0, 0) = t.spindle_mass;
  mass(0, 1) = mass(1, 0) = -t.spindle_mass * t.mass_behind;
  mass(1, 1) = t.spindle_inertia + t.spindle_mass * t.mass_behind * t.mass_behind;
  stiffness(0, 0) = t.stiffness_across;
  stiffness(0, 1) = stiffness(1, 0) = -t.stiffness_across * t.spring_behind;
  stiffness(1, 1) = t.stiffness_tilting + t.stiffness_across * t.spring_behind * t.spring_behind;
  const double length = t.stickout / ELEMENTS;
  for (int e = 0; e < ELEMENTS; ++e) {
    const double middle = (e + 0.5) * length;
    const double d = t.shank_diameter * (middle > t.stickout - t.fluted_length ? t.flute_ratio : 1.0);
    addBeamElement(length, t.young * units::PI / 64.0 * std::pow(d, 4), t.density * units::PI / 4.0 * d * d,
                   {2 * e, 2 * e + 1, 2 * e + 2, 2 * e + 3}, mass, stiffness);
  }
  return normalModes(mass, stiffness);
}

/// Deflection of every mode at a height above the tip, by the element's cubics.
Eigen::VectorXd deflections(const NormalModes& modes, const ToolInSpindle& t, double height) {
  const double l = t.stickout / ELEMENTS, x = t.stickout - height;
  const int e = std::min(ELEMENTS - 1, static_cast<int>(x / l));
  const double u = x / l - e;
  return modes.shapes.middleRows<4>(2 * e).transpose() * beamCubics(l, u);
}

}  // namespace

std::vector<PointMode> tipModes(const ToolInSpindle& tool, double below) {
  std::vector<PointMode> found;
  for (const CrossMode& m : crossModes(tool, 0.0, 0.0, below))
    found.push_back({m.frequency, tool.damping_ratio, m.gain});
  return found;
}

std::vector<CrossMode> crossModes(const ToolInSpindle& tool, double struck, double read, double below) {
  const NormalModes modes = modesOf(tool);
  const Eigen::VectorXd a = deflections(modes, tool, struck), b = deflections(modes, tool, read);
  std::vector<CrossMode> found;
  for (Eigen::Index m = 0; m < modes.squares.size(); ++m) {
    const double square = modes.squares[m], frequency = std::sqrt(square) / units::TWO_PI;
    if (frequency > below) break;
    found.push_back({frequency, a[m] * b[m] / square});
  }
  return found;
}

}  // namespace smartmill::plant
