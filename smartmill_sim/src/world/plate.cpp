#include "smartmill_sim/world/plate.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

Eigen::Matrix3d cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v(2), v(1), v(2), 0.0, -v(0), -v(1), v(0), 0.0;
  return m;
}

Eigen::Vector3d vectorOf(const std::array<double, 3>& v) {
  return {v[0], v[1], v[2]};
}

Matrix6 massOf(const PlateTraits& p) {
  const Eigen::Vector3d c = vectorOf(p.centre);
  Eigen::Vector3d inertia;  // of a cuboid about its centre
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double a = p.size[static_cast<std::size_t>((i + 1) % 3)];
    const double b = p.size[static_cast<std::size_t>((i + 2) % 3)];
    inertia(i) = p.mass * (a * a + b * b) / 12.0;
  }
  Matrix6 mass;
  mass << p.mass * Eigen::Matrix3d::Identity(), -p.mass * cross(c), p.mass * cross(c),
      Eigen::Matrix3d(inertia.asDiagonal()) - p.mass * cross(c) * cross(c);
  return mass;
}

/// Stiffness or damping matrix of the feet with constants along x, y, z: a foot at r moves by u + rotation x
/// r.
Matrix6 ofFeet(const PlateTraits& p, const Eigen::Vector3d& each) {
  Matrix6 sum = Matrix6::Zero();
  for (const double x : {-p.foot, p.foot}) {
    for (const double y : {-p.foot, p.foot}) {
      Eigen::Matrix<double, 3, 6> move;
      move << Eigen::Matrix3d::Identity(), -cross(Eigen::Vector3d(x, y, 0.0));
      sum += move.transpose() * each.asDiagonal() * move;
    }
  }
  return sum;
}

}  // namespace

void PlateTraits::declare(ParameterTable& table) {
  table.section(
      "Six-channel dynamometer (fx fy fz mx my mz) instead of the model's force sensor: a rigid plate on "
      "four feet.");
  table.flag("present", present, "whether it is under the workpiece");
  table.list("origin", origin, "m", Range{},
             "origin of the moments in the plane of the feet, machine coordinates");
  table.number("mass", mass, "kg", Range::open(0.0, 1e4), "moving mass of plate and workpiece");
  table.list("centre", centre, "m", Range::closed(-1.0, 1.0), "centre of mass, relative to the origin");
  table.list("size", size, "m", Range::open(0.0, 2.0), "edges of a cuboid with the same inertia");
  table.list("frequency", frequency, "Hz", Range::closed(100.0, 10000.0),
             "natural frequencies along x, y, z without rotation");
  table.number("foot", foot, "m", Range::open(0.0, 1.0),
               "distance of each foot from the x and y axes through the origin");
  table.number("damping", damping, "1", Range::open(0.0, 0.5), "damping ratio at these frequencies");
  table.number("force_noise", force_noise, "N", Range::notNegative(), "RMS of the forces");
  table.number("moment_noise", moment_noise, "N m", Range::notNegative(), "RMS of the moments");
}

Plate::Plate(const PlateTraits& traits, double step, std::uint64_t seed) : traits_(traits), random_(seed) {
  Eigen::Vector3d stiffness, damping;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double w = units::TWO_PI * traits.frequency[static_cast<std::size_t>(i)];
    stiffness(i) = traits.mass * w * w / 4.0;
    damping(i) = 2.0 * traits.damping * traits.mass * w / 4.0;
  }
  const Matrix6 k = ofFeet(traits, stiffness), c = ofFeet(traits, damping);
  const Eigen::MatrixXd inverse = linear::inverseSymmetric(Eigen::MatrixXd(massOf(traits)));
  // Velocities are scaled by the highest natural frequency, for states of equal size.
  const double fast = units::TWO_PI * *std::max_element(traits.frequency.begin(), traits.frequency.end());
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(24, 24);  // states, input, its change over the step
  a.block<6, 6>(0, 6) = fast * step * Matrix6::Identity();
  a.block<6, 6>(6, 0) = -step / fast * inverse * k;
  a.block<6, 6>(6, 6) = -step * inverse * c;
  a.block<6, 6>(6, 12) = step / fast * inverse;
  a.block<6, 6>(12, 18) = Matrix6::Identity();
  const Eigen::MatrixXd e = linear::exponential(a);
  transition_ = e.topLeftCorner<12, 12>();
  from_before_ = e.block<12, 6>(0, 12);
  from_change_ = e.block<12, 6>(0, 18);
  output_ << k, fast * c;
}

void Plate::step(const std::array<double, 3>& cut, const std::array<double, 3>& cut_point,
                 const std::array<double, 3>& hit, const std::array<double, 3>& hit_point) {
  Eigen::Matrix<double, 6, 1> wrench;
  const Eigen::Vector3d f = vectorOf(cut), r = vectorOf(cut_point) - vectorOf(traits_.origin);
  const Eigen::Vector3d b = vectorOf(hit);
  wrench << f + b, cross(r) * f + cross(vectorOf(hit_point)) * b;
  ++steps_;
  // A free vibration ends before it has decayed to denormal numbers, with which a processor is slow.
  const bool free = wrench.isZero(0.0) && last_.isZero(0.0);
  if (free && state_.squaredNorm() < 1e-300) {
    state_.setZero();
    return;
  }
  state_ = transition_ * state_ + from_before_ * last_ + from_change_ * (wrench - last_);
  last_ = wrench;
  sum_ += output_ * state_;
}

std::array<double, 6> Plate::read() {
  std::array<double, 6> output{};
  for (std::size_t i = 0; i < 6; ++i) {
    const double noise = i < 3 ? traits_.force_noise : traits_.moment_noise;
    output[i] = sum_(static_cast<Eigen::Index>(i)) / std::max(1, steps_) + noise * normal_(random_);
  }
  sum_.setZero();
  steps_ = 0;
  return output;
}

}  // namespace smartmill::sim
