#pragma once

#include <array>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "smartmill_stability/solvers/solver.h"

namespace smartmill::stability {

std::unique_ptr<FloquetSolver> makeCollocation(const RegenerativeSystem& system,
                                               const SolverOptions& options);
std::unique_ptr<FloquetSolver> makeSemiDiscretization(const RegenerativeSystem& system,
                                                      const SolverOptions& options);
std::unique_ptr<StabilitySolver> makeMultiFrequency(const RegenerativeSystem& system,
                                                    const SolverOptions& options);

std::unique_ptr<StabilitySolver> makeZeroOrder(const RegenerativeSystem& system);

/// @throws Error on an invalid system or one without dynamics.
void needDynamics(const RegenerativeSystem& system);

/// Nodes and weights of the three-point Gauss quadrature on [-1, 1].
inline constexpr std::array<std::array<double, 2>, 3> GAUSS{
    {{{-0.7745966692414834, 5.0 / 9.0}}, {{0.0, 8.0 / 9.0}}, {{0.7745966692414834, 5.0 / 9.0}}}};

/// Axes along which a mode is excited or moves; along the others the tool is rigid.
struct Axes {
  explicit Axes(const std::vector<SystemMode>& modes);
  Eigen::Index count() const { return static_cast<Eigen::Index>(index.size()); }
  Eigen::MatrixXd reduced(const Eigen::Matrix2d& full) const;
  std::vector<std::size_t> index;
};

/// d n^T at an immersion angle [rad]: force d on the tool per depth and chip thickness, n: normal of the
/// chip.
/// @param tangential, radial [N/m2]
Eigen::Matrix2d directional(double tangential, double radial, double angle);

/// [rad/s] Upper end of the search for the chatter frequency: 1.5 times the highest natural frequency.
double highestOf(const RegenerativeSystem& system);

}  // namespace smartmill::stability
