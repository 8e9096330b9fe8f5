#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "solvers/floquet.h"

namespace smartmill::stability {

/// Resolution of the collocation.
struct CollocationResolution {
  /// [rad] Largest phase of vibration and feedback over an element; with the default of 12 nodes the error of
  /// the depth is 1e-7.
  double phase = 9.0;
  int nodes = 12;      ///< [1] of an element
  int refinement = 4;  ///< [1] nodes more for the estimate of the error: a hundredth of the error or less
  /// [1] Relative tolerance of an eigenvalue: its share in the tolerance of the depth, so that it does not
  /// add to the error, within the precision that the elements reach and one that is enough for any chart.
  double eigenvalue_share = 1e-3, finest_eigenvalue = 1e-9, coarsest_eigenvalue = 1e-6;
  /// [1] The same share for thousands of multipliers, whose roots are interpolated.
  double eigenvalue_share_of_many = 0.1;
  /// [1] A mode with a larger damping ratio among others represents a residual compliance: it follows the
  /// force immediately, and elements need not resolve it.
  double heavy_damping = 0.4;
  double table_error = 1e-9;  ///< [1] of tabulated responses, as small as the error of the depth
};
inline constexpr CollocationResolution COLLOCATION;

/// Nodes, quadrature and interpolation on the unit interval.
struct ReferenceElement {
  explicit ReferenceElement(int count);
  /// Lagrange polynomials at x in [0, 1], barycentric.
  Eigen::VectorXd weights(double x) const;

  int n;
  std::vector<double> node, gauss, weight;
  std::vector<Eigen::MatrixXd> lagrange;  ///< for each node: the polynomials (rows) at node times each Gauss
                                          ///< point
  Eigen::VectorXd quadrature;             ///< weights of the nodes for the integral over [0, 1]

 private:
  void gaussRule(int points);
};

/// Response of the modes over an element of one length. State of a mode: q, q'/w.
struct ElementResponse {
  double length = 0.0;
  Eigen::MatrixXd motion, velocity;              ///< (n D) x 2M: from the state at the start
  Eigen::MatrixXd force_motion, force_velocity;  ///< (n D) x (n D)
  Eigen::MatrixXd state, force_state;            ///< 2M x 2M, 2M x (n D): state at the end
};

/// [rad/s] Fastest vibration that the elements resolve. @param stiffness [N/m] of the feedback
double fastestOf(const std::vector<SystemMode>& modes, double stiffness);

/// Responses for every length up to the longest as Chebyshev series in the length. All entries are sums of
/// exponentials of the length, so the terms decrease as (r / 2)^k / k!, with r the largest pole times half
/// the longest length.
class ResponseTable {
 public:
  ResponseTable(const std::vector<SystemMode>& modes, const ReferenceElement& reference, bool with_velocity);
  double longest() const { return longest_; }
  ElementResponse at(double length) const;

 private:
  double longest_;
  ElementResponse example_;       ///< provides the sizes of the matrices
  Eigen::MatrixXd coefficients_;  ///< entries x terms
};

/// Cache of the responses at one speed; without helix they are the same at every depth.
class ResponseCache {
 public:
  ResponseCache(const std::vector<SystemMode>& of_modes, std::shared_ptr<const ReferenceElement> of_reference,
                bool velocities, std::shared_ptr<const ResponseTable> of_table = nullptr);
  std::shared_ptr<const ElementResponse> of(double length);

  std::vector<SystemMode> modes;
  Axes axes;
  std::shared_ptr<const ReferenceElement> reference;
  bool with_velocity;
  Eigen::Index expected = 0;  ///< number of applications for the last eigenvalue
  double eigenvalue_tolerance = COLLOCATION.finest_eigenvalue;

 private:
  std::shared_ptr<const ResponseTable> table_;
  std::vector<std::shared_ptr<const ElementResponse>> cached_;
};

}  // namespace smartmill::stability
