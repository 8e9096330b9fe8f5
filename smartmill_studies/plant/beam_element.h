#pragma once

#include <Eigen/Core>
#include <array>

namespace smartmill::plant {

/// Deflection and slope at both ends of a beam element in the coordinates of a structure.
using ElementCoordinates = std::array<Eigen::Index, 4>;

/// Adds an Euler-Bernoulli element (Hermite cubics) to the matrices of a structure.
/// @param length [m] @param bending [N m2] @param mass_per_length [kg/m]
void addBeamElement(double length, double bending, double mass_per_length, const ElementCoordinates& at,
                    Eigen::MatrixXd& mass, Eigen::MatrixXd& stiffness);

/// The four cubics at a point of the element. @param u [1] 0..1, from its first end
Eigen::Vector4d beamCubics(double length, double u);

/// Squared angular frequencies [rad2/s2], lowest first, and mass-normalised shapes (columns).
struct NormalModes {
  Eigen::VectorXd squares;
  Eigen::MatrixXd shapes;
};
/// K v = w^2 M v. @param mass positive definite
NormalModes normalModes(const Eigen::MatrixXd& mass, const Eigen::MatrixXd& stiffness);

}  // namespace smartmill::plant
