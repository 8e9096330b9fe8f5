#pragma once

#include <array>

#include <Eigen/Core>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"

namespace smartmill::loadmeter {

/// Covariance of Ktc [N/m2] and Kte [N/m]. Infinite standard deviations: unknown.
struct TorqueCovariance {
  double tc = 0.0, tc_te = 0.0, te = 0.0;
};

/// Coefficients that mean torque and mean forces in the plane of the feed determine, in this order.
enum PlaneCoefficient { PLANE_KTC, PLANE_KTE, PLANE_KRC, PLANE_KRE, PLANE_COEFFICIENTS };

/// Covariance of Ktc, Krc [N/m2] and Kte, Kre [N/m], row by row. Infinite variance: unknown.
struct PlaneCovariance {
  std::array<double, PLANE_COEFFICIENTS * PLANE_COEFFICIENTS> value{};

  double at(std::size_t i, std::size_t j) const { return value[PLANE_COEFFICIENTS * i + j]; }
  double stdOf(std::size_t i) const;
  TorqueCovariance torque() const { return {at(0, 0), at(0, 1), at(1, 1)}; }
};

/// Information of air cuts and cuts of any engagement about the coefficients and the friction of the spindle
/// (Coulomb and viscous). Mean voltage of the load meter: V = K w (T + coulomb + viscous w), T = N a R / (2
/// pi) (f (cos entry - cos exit) Ktc + (exit - entry) Kte) (eq. 3.5, 3.14 and 3.19 for any engagement); mean
/// forces by meanForceMatrix(). The model is linear: the information is that of weighted least squares.
///
/// A slot and both half immersions have the same ratio of chip to edge term. Their information about Ktc and
/// Kte differs by the square of the axial depth times 1 (slot) or 1/2 (half immersion) only.
class CutInformation {
 public:
  /// Earlier knowledge of Ktc and Kte; infinite variances add nothing.
  void addKnowledge(const TorqueCovariance& covariance);
  /// Air cut or cut at a speed. @param voltage_std [V] of its mean voltage
  void addTest(const CuttingCondition& test, const Spindle& spindle, double voltage_std);
  /// Cut with an air cut at the same speed, which is subtracted: the friction is not estimated.
  void addAboveAir(const CuttingCondition& cut, const Spindle& spindle, double voltage_std);
  /// Mean forces of a cut along its feed and across, by a force sensor. @param force_std [N] of each
  void addForces(const CuttingCondition& cut, double force_std);

  /// With the friction of the spindle unknown but for the tests.
  PlaneCovariance covariance() const;
  /// Half the logarithm of the determinant of the covariance of Ktc [GPa] and Kte [N/mm]; +inf: unknown. The
  /// information gain of a cut [nat] is the difference before and after it.
  double entropy() const;

 private:
  // Ktc, Kte, Krc, Kre, Coulomb [N m] and viscous [N m s/rad] friction, scaled to similar magnitudes.
  using Vector = Eigen::Matrix<double, 6, 1>;
  static const Vector& scale();
  static void setTorque(const CuttingCondition& cut, Vector* row);
  void add(const Vector& row, double std_dev);

  Eigen::Matrix<double, 6, 6> information_ = Eigen::Matrix<double, 6, 6>::Zero();
};

}  // namespace smartmill::loadmeter
