#include "plant/beam.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {
namespace {

constexpr int ELEMENTS = 12;

// Mass and stiffness of a beam element over deflection and slope at both ends (Hermite cubics).
void addElement(double length, double bending, double mass_per_length, int at, Eigen::MatrixXd& mass,
                Eigen::MatrixXd& stiffness) {
  const double l = length, l2 = l * l;
  Eigen::Matrix4d k, m;
  k << 12, 6 * l, -12, 6 * l, 6 * l, 4 * l2, -6 * l, 2 * l2, -12, -6 * l, 12, -6 * l, 6 * l, 2 * l2, -6 * l,
      4 * l2;
  m << 156, 22 * l, 54, -13 * l, 22 * l, 4 * l2, 13 * l, -3 * l2, 54, 13 * l, 156, -22 * l, -13 * l, -3 * l2,
      -22 * l, 4 * l2;
  stiffness.block<4, 4>(at, at) += bending / (l2 * l) * k;
  mass.block<4, 4>(at, at) += mass_per_length * l / 420.0 * m;
}

}  // namespace

namespace {

constexpr int SIZE = 2 * (ELEMENTS + 1);

/// Squared angular frequencies and mass-normalised shapes.
struct Shapes {
  Eigen::VectorXd squares;
  Eigen::MatrixXd shapes;
};

Shapes shapesOf(const ToolInSpindle& t) {
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
    addElement(length, t.young * units::PI / 64.0 * std::pow(d, 4), t.density * units::PI / 4.0 * d * d,
               2 * e, mass, stiffness);
  }
  // K v = w^2 M v with M = S S', S from M's own eigenvectors.
  const linear::SymmetricEigensystem of_mass = linear::symmetricEigensystem(mass);
  const Eigen::MatrixXd root =
      of_mass.vectors * of_mass.values.cwiseSqrt().cwiseInverse().asDiagonal();  // root' M root = 1
  const linear::SymmetricEigensystem modes =
      linear::symmetricEigensystem(root.transpose() * stiffness * root);
  return {modes.values, root * modes.vectors};
}

/// Deflection of every mode at a height above the tip, by the element's cubics.
Eigen::VectorXd deflections(const Shapes& modes, const ToolInSpindle& t, double height) {
  const double l = t.stickout / ELEMENTS, x = t.stickout - height;
  const int e = std::min(ELEMENTS - 1, static_cast<int>(x / l));
  const double u = x / l - e;
  return (1.0 - 3.0 * u * u + 2.0 * u * u * u) * modes.shapes.row(2 * e).transpose() +
         l * (u - 2.0 * u * u + u * u * u) * modes.shapes.row(2 * e + 1).transpose() +
         (3.0 * u * u - 2.0 * u * u * u) * modes.shapes.row(2 * e + 2).transpose() +
         l * (u * u * u - u * u) * modes.shapes.row(2 * e + 3).transpose();
}

}  // namespace

std::vector<PointMode> tipModes(const ToolInSpindle& tool, double below) {
  std::vector<PointMode> found;
  for (const CrossMode& m : crossModes(tool, 0.0, 0.0, below))
    found.push_back({m.frequency, tool.damping_ratio, m.gain});
  return found;
}

std::vector<CrossMode> crossModes(const ToolInSpindle& tool, double struck, double read, double below) {
  const Shapes modes = shapesOf(tool);
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
