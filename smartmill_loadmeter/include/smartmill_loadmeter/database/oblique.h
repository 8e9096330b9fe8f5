#pragma once

#include <array>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"

namespace smartmill::loadmeter {

/// Shear zone of a pair of work and tool material, independent of the tool's geometry.
struct ShearZone {
  double shear_stress = 0.0;    ///< [N/m2]
  double shear_angle = 0.0;     ///< [rad]
  double friction_angle = 0.0;  ///< [rad] mean, on the rake face
};

/// Cutting coefficients (edge terms zero) of an edge with normal rake [rad] and inclination (helix) [rad]:
/// Budak, Altintas, Armarego 1996, chip flow angle = inclination (Stabler), tan(bn) = tan(ba)
/// cos(inclination):
///   D = sqrt(cos^2(pn + bn - an) + tan^2(i) sin^2(bn))
///   Ktc = ts / sin(pn) (cos(bn - an) + tan^2(i) sin(bn)) / D,  Krc = ts / (sin(pn) cos(i)) sin(bn - an) / D,
///   Kac = ts / sin(pn) tan(i) (cos(bn - an) - sin(bn)) / D.
CuttingCoefficients obliqueCoefficients(const ShearZone& zone, double rake, double inclination);

/// Coefficients identified with one tool.
struct ObliqueSet {
  double rake = 0.0;                   ///< [rad] normal
  double inclination = 0.0;            ///< [rad] helix
  CuttingCoefficients value, std_dev;  ///< NaN: not identified
};

/// Orthogonal parameters of a material pair from milling coefficients, without measured chips: the inverse of
/// obliqueCoefficients() for all sets together, with friction_angle = friction + friction_slope x rake
/// and shear_angle = shear + shear_slope (rake - friction_angle). Milling coefficients do not determine the
/// shear angle, so prior knowledge of metals enters as observations: shear 45 +- 6 deg, shear_slope 0.75 +-
/// 0.25 (Merchant 0.5, Lee and Shaffer 1), friction_slope 0.3 +- 0.3, friction 25 +- 15 deg.
struct OrthogonalParameters {
  static constexpr std::size_t COUNT = 5;
  /// shear_stress [N/m2], friction [rad], friction_slope, shear [rad], shear_slope
  std::array<double, COUNT> value{};
  std::array<double, COUNT * COUNT> covariance{};  ///< row by row
  double kte = 0.0, kte_std = 0.0;                 ///< [N/m] independent of the rake; NaN: not identified
  double kre = 0.0, kre_std = 0.0;                 ///< [N/m]
  double kae = 0.0, kae_std = 0.0;                 ///< [N/m] per sine of the inclination
  int sets = 0;

  ShearZone at(double rake) const;
};

/// @throws Error when no set has Ktc, or an edge is out of range (|rake| < 60 deg, 0 <= inclination < 80
/// deg).
OrthogonalParameters semiInverse(const std::vector<ObliqueSet>& sets);

/// Prediction for another geometry; the standard deviations contain the covariance and a model error of 3 %
/// of each coefficient. @throws Error as above.
CoefficientSet predict(const OrthogonalParameters& parameters, double rake, double inclination);

}  // namespace smartmill::loadmeter
