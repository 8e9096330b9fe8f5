#include "cut_mechanics.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
constexpr int ANGLES = 64;            // per tooth period
constexpr double FACING_SINE = 1e-3;  // of a feed along X, up to the noise of positions

}  // namespace

Eigen::Matrix3d feedFrame(const ToolGeometry& tool, double heading) {
  const double c = std::cos(heading), s = std::sin(heading);
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (tool.teeth > 0) {
    turn.topLeftCorner<2, 2>() << c, -s, s, c;
    return turn;
  }
  // Turning: the edge points away from the workpiece, to +X, in facing to +Z.
  const bool facing = std::abs(s) < FACING_SINE;
  turn.col(0) = Eigen::Vector3d(c, 0.0, s);
  turn.col(2) =
      facing ? Eigen::Vector3d(0.0, 0.0, 1.0) : Eigen::Vector3d(std::abs(s), 0.0, -c * std::copysign(1.0, s));
  return turn;
}

CutMechanics::CutMechanics(const CutMeasurements& r, const ForceEstimateParameters& p)
    : ktc_(p.ktc), kte_(p.kte) {
  const auto map = meanForceMatrix(r.tool, r.engagement);
  Eigen::Matrix<double, 4, 6> own;
  for (int f = 0; f < 4; ++f) {
    for (int c = 0; c < 6; ++c) own(f, c) = map[static_cast<std::size_t>(f)][static_cast<std::size_t>(c)];
  }
  const Eigen::Matrix3d turn = feedFrame(r.tool, r.heading);
  mean_.topRows<3>() = turn * own.topRows<3>();
  mean_.row(3) = own.row(3);
  for (Matrix6& q : squares_) q.setZero();
  if (r.tool.teeth == 0) return;  // the force of a turning cut does not vary
  std::vector<MechanisticForce> units;
  for (const CuttingKey& key : cuttingKeys()) {
    CuttingCoefficients one{0, 0, 0, 0, 0, 0};
    one.*key.coefficient = 1.0;
    units.emplace_back(r.tool, one, r.engagement);
  }
  Eigen::Matrix<double, 3, 6> own_mean = Eigen::Matrix<double, 3, 6>::Zero();
  std::vector<Eigen::Matrix<double, 3, 6>> all;
  for (int i = 0; i < ANGLES; ++i) {
    const double angle = units::TWO_PI / r.tool.teeth * (i + 0.5) / ANGLES;
    Eigen::Matrix<double, 3, 6> at;
    for (int c = 0; c < 6; ++c) {
      const CuttingForce f = units[static_cast<std::size_t>(c)].at(angle);
      at.col(c) = Eigen::Vector3d(f.fx, f.fy, f.fz);
    }
    all.push_back(turn * at);
    own_mean += all.back() / ANGLES;
  }
  for (int a = 0; a < 3; ++a) addSquares(all, own_mean, a);
}

Eigen::VectorXd CutMechanics::of(const Eigen::VectorXd& at) const {
  Vector6 k;
  k << at[0] * ktc_, at[0] * ktc_ * at[1], at[0] * ktc_ * at[2], at[3] * kte_, at[3] * kte_ * at[4],
      at[3] * kte_ * at[5];
  Eigen::VectorXd all(QUANTITIES);
  all.head<4>() = mean_ * k;
  for (int q = RMS; q < QUANTITIES; ++q) {
    const double square = std::max(1e-12, k.dot(squares_[static_cast<std::size_t>(q - RMS)] * k));
    all[q] = q < LINES ? std::sqrt(square) : square;
  }
  return all;
}

// Variance of an axis over a tooth period and squared amplitudes of its harmonics.
void CutMechanics::addSquares(const std::vector<Unit>& all, const Unit& mean, int axis) {
  const auto square = [this](int quantity) -> Matrix6& {
    return squares_[static_cast<std::size_t>(quantity - RMS)];
  };
  std::array<Vector6, 2 * TOOTH_HARMONICS> parts;
  for (Vector6& part : parts) part.setZero();
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Vector6 away = (all[i] - mean).row(axis).transpose();
    square(RMS + axis) += away * away.transpose() / ANGLES;
    for (std::size_t k = 0; k < TOOTH_HARMONICS; ++k) {
      const double turned = units::TWO_PI * static_cast<double>((k + 1) * i) / ANGLES;
      parts[2 * k] += 2.0 / ANGLES * std::cos(turned) * away;
      parts[2 * k + 1] += 2.0 / ANGLES * std::sin(turned) * away;
    }
  }
  for (int k = 0; k < 2 * TOOTH_HARMONICS; ++k) {
    const Vector6& part = parts[static_cast<std::size_t>(k)];
    square(lineOf(axis, 1 + k / 2)) += part * part.transpose();
  }
}

}  // namespace smartmill::loadmeter
