#include "plant/plate.h"

#include <Eigen/Core>
#include <cmath>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::plant {
namespace {

// Displacement of a point of the plate along x, y, z by its six coordinates (translations, small rotations).
Eigen::Matrix<double, 3, 6> motionAt(const std::array<double, 3>& r) {
  Eigen::Matrix<double, 3, 6> m;
  m << 1, 0, 0, 0, r[2], -r[1], 0, 1, 0, -r[2], 0, r[0], 0, 0, 1, r[1], -r[0], 0;
  return m;
}

}  // namespace

std::vector<SensorMode> modesOf(const Plate& p) {
  Eigen::Matrix<double, 6, 1> inertia;
  const auto& s = p.size;
  inertia << p.mass, p.mass, p.mass, p.mass / 12.0 * (s[1] * s[1] + s[2] * s[2]),
      p.mass / 12.0 * (s[0] * s[0] + s[2] * s[2]), p.mass / 12.0 * (s[0] * s[0] + s[1] * s[1]);
  const Eigen::Matrix3d spring = Eigen::Vector3d(p.stiffness[0], p.stiffness[1], p.stiffness[2]).asDiagonal();
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(6, 6), output = Eigen::MatrixXd::Zero(3, 6);
  for (const double x : {-p.springs[0], p.springs[0]}) {
    for (const double y : {-p.springs[1], p.springs[1]}) {
      const Eigen::Matrix<double, 3, 6> m = motionAt({x, y, -p.springs[2]});
      stiffness += m.transpose() * spring * m;
      output += spring * m;
    }
  }
  const Eigen::MatrixXd input = motionAt(p.force_point);
  const Eigen::VectorXd root = inertia.cwiseSqrt().cwiseInverse();
  const linear::SymmetricEigensystem modes =
      linear::symmetricEigensystem(root.asDiagonal() * stiffness * root.asDiagonal());
  std::vector<SensorMode> found;
  for (Eigen::Index k = 0; k < 6; ++k) {
    const double square = modes.values[k];
    const Eigen::VectorXd shape = root.asDiagonal() * modes.vectors.col(k);
    SensorMode mode;
    mode.frequency = std::sqrt(square) / units::TWO_PI;
    mode.damping_ratio = p.damping_ratio;
    for (int a = 0; a < 3; ++a) {
      mode.input[a] = input.row(a).dot(shape) / square;
      mode.output[a] = output.row(a).dot(shape);
    }
    found.push_back(mode);
  }
  return found;
}

}  // namespace smartmill::plant
