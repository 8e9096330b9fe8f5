#include "plant/beam.h"

#include <Eigen/Core>
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

std::vector<PointMode> tipModes(const ToolInSpindle& t, double below) {
  const int size = 2 * (ELEMENTS + 1);
  Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(size, size), stiffness = mass;
  mass(0, 0) = t.spindle_mass;
  mass(1, 1) = t.spindle_inertia;
  stiffness(0, 0) = t.stiffness_across;
  stiffness(1, 1) = t.stiffness_tilting;
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
  std::vector<PointMode> found;
  for (Eigen::Index m = 0; m < modes.values.size(); ++m) {
    const double square = modes.values[m], frequency = std::sqrt(square) / units::TWO_PI;
    if (frequency > below) break;
    const double at_tip = (root * modes.vectors.col(m))[size - 2];
    found.push_back({frequency, t.damping_ratio, at_tip * at_tip / square});
  }
  return found;
}

}  // namespace smartmill::plant
