#include "smartmill_loadmeter/identification/cut_information.h"

#include <Eigen/Dense>

#include <cmath>
#include <limits>
#include <vector>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/identification/torque_sensitivity.h"

namespace smartmill::loadmeter {

namespace {

enum { COULOMB = PLANE_COEFFICIENTS, VISCOUS };
// Columns of meanForceMatrix() of the coefficients in the plane, in their order.
constexpr std::array<std::size_t, PLANE_COEFFICIENTS> COLUMN{0, 3, 1, 4};
constexpr double UNKNOWN = std::numeric_limits<double>::infinity();
constexpr double SINGULAR = 1e-12;  // [1] smallest over largest eigenvalue

}  // namespace

double PlaneCovariance::stdOf(std::size_t i) const {
  return std::sqrt(at(i, i));
}

const CutInformation::Vector& CutInformation::scale() {
  static const Vector scale = [] {
    Vector v;
    v << 1e9, 1e4, 1e9, 1e4, 0.1, 1e-3;
    return v;
  }();
  return scale;
}

void CutInformation::add(const Vector& row, double std_dev) {
  const Vector scaled = row.cwiseProduct(scale()) / std_dev;
  information_ += scaled * scaled.transpose();
}

void CutInformation::addKnowledge(const TorqueCovariance& known) {
  if (!std::isfinite(known.tc) || !std::isfinite(known.te)) return;
  Eigen::Matrix2d covariance;
  covariance << known.tc, known.tc_te, known.tc_te, known.te;
  const Eigen::Vector2d unscale = scale().head<2>().cwiseInverse();
  covariance = unscale.asDiagonal() * covariance * unscale.asDiagonal();
  information_.topLeftCorner<2, 2>() += covariance.inverse();
}

void CutInformation::setTorque(const CuttingCondition& cut, Vector* row) {
  const TorqueSensitivity torque = torqueSensitivity(cut.tool, cut.engagement);
  (*row)[PLANE_KTC] = torque.tc;
  (*row)[PLANE_KTE] = torque.te;
}

// Eq. 3.12: the torque per volt falls with the speed.
void CutInformation::addTest(const CuttingCondition& test, const Spindle& spindle, double voltage_std) {
  Vector row = Vector::Zero();
  row[COULOMB] = 1.0;
  row[VISCOUS] = test.spindle_speed;
  if (test.kind == CuttingCondition::Kind::cut) {
    setTorque(test, &row);
  }
  add(row, voltage_std / (spindle.load_meter_gain * test.spindle_speed));
}

void CutInformation::addAboveAir(const CuttingCondition& cut, const Spindle& spindle, double voltage_std) {
  Vector row = Vector::Zero();
  setTorque(cut, &row);
  add(row, std::sqrt(2.0) * voltage_std / (spindle.load_meter_gain * cut.spindle_speed));
}

void CutInformation::addForces(const CuttingCondition& cut, double force_std) {
  const auto map = meanForceMatrix(cut.tool, cut.engagement);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    Vector row = Vector::Zero();
    for (std::size_t i = 0; i < COLUMN.size(); ++i) row[static_cast<Eigen::Index>(i)] = map[axis][COLUMN[i]];
    add(row, force_std);
  }
}

PlaneCovariance CutInformation::covariance() const {
  PlaneCovariance covariance;
  for (std::size_t i = 0; i < PLANE_COEFFICIENTS; ++i) covariance.value[PLANE_COEFFICIENTS * i + i] = UNKNOWN;
  std::vector<Eigen::Index> seen;  // unknowns on which a test depends
  for (Eigen::Index i = 0; i < information_.rows(); ++i) {
    if (information_(i, i) > 0.0) seen.push_back(i);
  }
  if (seen.empty()) return covariance;
  const Eigen::MatrixXd information = information_(seen, seen);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information);
  if (!(eigen.eigenvalues()[0] > SINGULAR * eigen.eigenvalues()[eigen.eigenvalues().size() - 1]))
    return covariance;
  const Eigen::MatrixXd inverse = information.inverse();
  for (std::size_t a = 0; a < seen.size() && seen[a] < PLANE_COEFFICIENTS; ++a) {
    for (std::size_t b = 0; b < seen.size() && seen[b] < PLANE_COEFFICIENTS; ++b) {
      covariance
          .value[PLANE_COEFFICIENTS * static_cast<std::size_t>(seen[a]) + static_cast<std::size_t>(seen[b])] =
          inverse(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) * scale()[seen[a]] *
          scale()[seen[b]];
    }
  }
  return covariance;
}

double CutInformation::entropy() const {
  const TorqueCovariance c = covariance().torque();
  if (!std::isfinite(c.tc) || !std::isfinite(c.te)) return UNKNOWN;
  const double unit = units::N_PER_MM2 * 1e3 * units::N_PER_MM;  // GPa times N/mm
  return 0.5 * std::log((c.tc * c.te - c.tc_te * c.tc_te) / (unit * unit));
}

}  // namespace smartmill::loadmeter
