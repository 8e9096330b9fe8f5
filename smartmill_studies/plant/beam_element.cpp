#include "plant/beam_element.h"

#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::plant {

void addBeamElement(double length, double bending, double mass_per_length, const ElementCoordinates& at,
                    Eigen::MatrixXd& mass, Eigen::MatrixXd& stiffness) {
  const double l = length, l2 = l * l;
  Eigen::Matrix4d k, m;
  k << 12, 6 * l, -12, 6 * l, 6 * l, 4 * l2, -6 * l, 2 * l2, -12, -6 * l, 12, -6 * l, 6 * l, 2 * l2, -6 * l,
      4 * l2;
  m << 156, 22 * l, 54, -13 * l, 22 * l, 4 * l2, 13 * l, -3 * l2, 54, 13 * l, 156, -22 * l, -13 * l, -3 * l2,
      -22 * l, 4 * l2;
  k *= bending / (l2 * l);
  m *= mass_per_length * l / 420.0;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      stiffness(at[i], at[j]) += k(i, j);
      mass(at[i], at[j]) += m(i, j);
    }
  }
}

Eigen::Vector4d beamCubics(double length, double u) {
  return {1.0 - 3.0 * u * u + 2.0 * u * u * u, length * (u - 2.0 * u * u + u * u * u),
          3.0 * u * u - 2.0 * u * u * u, length * (u * u * u - u * u)};
}

NormalModes normalModes(const Eigen::MatrixXd& mass, const Eigen::MatrixXd& stiffness) {
  // M = S S', S from M's own eigenvectors.
  const linear::SymmetricEigensystem of_mass = linear::symmetricEigensystem(mass);
  const Eigen::MatrixXd root =
      of_mass.vectors * of_mass.values.cwiseSqrt().cwiseInverse().asDiagonal();  // root' M root = 1
  const linear::SymmetricEigensystem modes =
      linear::symmetricEigensystem(root.transpose() * stiffness * root);
  return {modes.values, root * modes.vectors};
}

}  // namespace smartmill::plant
