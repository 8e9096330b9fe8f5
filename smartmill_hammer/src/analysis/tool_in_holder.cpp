#include "tool_in_holder.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/units.h"

namespace smartmill::hammer {
namespace {

using Eigen::Index;
using Eigen::Matrix4d;
using Eigen::MatrixXd;

constexpr int ELEMENTS = 7;
constexpr Index TOOL = 2 * (ELEMENTS + 1);
constexpr double POISSON = 0.25, SHEAR_SHARE = 0.89;  // of a round section

/// Adds an element's stiffness and mass matrices. @param bending, shear stiffness of the section
void addElement(double l, double bending, double shear, double mass, double inertia, Index at, MatrixXd& m,
                MatrixXd& k) {
  const double phi = 12.0 * bending / (shear * l * l), l2 = l * l;
  Matrix4d stiffness, translation, rotation;
  stiffness << 12, 6 * l, -12, 6 * l, 6 * l, (4 + phi) * l2, -6 * l, (2 - phi) * l2, -12, -6 * l, 12, -6 * l,
      6 * l, (2 - phi) * l2, -6 * l, (4 + phi) * l2;
  translation << 156, 22 * l, 54, -13 * l, 22 * l, 4 * l2, 13 * l, -3 * l2, 54, 13 * l, 156, -22 * l, -13 * l,
      -3 * l2, -22 * l, 4 * l2;
  rotation << 36, 3 * l, -36, 3 * l, 3 * l, 4 * l2, -3 * l, -l2, -36, -3 * l, 36, -3 * l, 3 * l, -l2, -3 * l,
      4 * l2;
  k.block<4, 4>(at, at) += bending / (l2 * l * (1.0 + phi)) * stiffness;
  m.block<4, 4>(at, at) += mass * l / 420.0 * translation + inertia / (30.0 * l) * rotation;
}

/// Section of an element; averages where it is partly fluted.
struct Section {
  double bending, shear, mass, inertia;
};
Section sectionOf(const ToolInHolder& t, double x, double l) {
  const double fluted = std::clamp((t.fluted_length - x) / l, 0.0, 1.0);
  const auto power = [&](int n) {
    return fluted * std::pow(t.fluted_diameter, n) + (1.0 - fluted) * std::pow(t.diameter, n);
  };
  // Bending compliances add up: the mean of 1 / d^4.
  const double soft =
      1.0 / (fluted / std::pow(t.fluted_diameter, 4) + (1.0 - fluted) / std::pow(t.diameter, 4));
  const double area = 0.25 * units::PI * power(2), second = units::PI / 64.0;
  return {t.young * second * soft, SHEAR_SHARE * area * t.young / (2.0 * (1.0 + POISSON)), t.density * area,
          t.density * second * power(4)};
}

}  // namespace

double HeldMode::deflection(double height) const {
  const auto last = shape.size() / 2 - 2;
  const std::size_t e = std::min(last, static_cast<std::size_t>(std::max(0.0, height / element)));
  const double u = height / element - static_cast<double>(e);
  const double *left = &shape[2 * e], *right = &shape[2 * e + 2];
  return left[0] * (1.0 - 3.0 * u * u + 2.0 * u * u * u) + element * left[1] * (u - 2.0 * u * u + u * u * u) +
         right[0] * (3.0 * u * u - 2.0 * u * u * u) + element * right[1] * (u * u * u - u * u);
}

double HeldMode::gain(double struck, double read) const {
  return deflection(struck) * deflection(read) / std::pow(units::TWO_PI * frequency, 2);
}

namespace {

/// Stiffness and mass of the free beam and of the spindle modes (of mass 1). x runs from the tip: with a
/// positive tilt the deflection falls towards the spindle.
void assemble(const ToolInHolder& t, MatrixXd& stiffness, MatrixXd& mass) {
  const auto spindle = static_cast<Index>(t.spindle.size());
  const Index size = TOOL + spindle;
  mass = stiffness = MatrixXd::Zero(size, size);
  const double l = t.stickout / ELEMENTS;
  for (int e = 0; e < ELEMENTS; ++e) {
    const Section s = sectionOf(t, e * l, l);
    addElement(l, s.bending, s.shear, s.mass, s.inertia, 2 * e, mass, stiffness);
  }
  MatrixXd lateral = MatrixXd::Zero(1, size), rotation = lateral;
  lateral(0, TOOL - 2) = rotation(0, TOOL - 1) = 1.0;
  for (Index i = 0; i < spindle; ++i) {
    const SpindleMode& m = t.spindle[static_cast<std::size_t>(i)];
    const double omega = units::TWO_PI * m.frequency, tip = omega * std::sqrt(m.gain);
    lateral(0, TOOL + i) = -tip * (1.0 - m.tilt * t.stickout);
    rotation(0, TOOL + i) = tip * m.tilt;
    mass(TOOL + i, TOOL + i) = 1.0;
    stiffness(TOOL + i, TOOL + i) = omega * omega;
  }
  stiffness += t.lateral_stiffness * lateral.transpose() * lateral +
               t.rotational_stiffness * rotation.transpose() * rotation;
}

}  // namespace

HeldTool::HeldTool(const ToolInHolder& t) {
  assemble(t, stiffness_, mass_);
  // K v = w^2 M v with M = S S', S from M's own eigenvectors.
  const linear::SymmetricEigensystem of_mass = linear::symmetricEigensystem(mass_);
  if (!(of_mass.values.minCoeff() > 0.0)) return;
  const MatrixXd root = of_mass.vectors * of_mass.values.cwiseSqrt().cwiseInverse().asDiagonal();
  const linear::SymmetricEigensystem modes =
      linear::symmetricEigensystem(root.transpose() * stiffness_ * root);
  shapes_ = root * modes.vectors;
  squares_ = modes.values;
  for (Index k = 0; k < squares_.size(); ++k)
    modes_.push_back(
        modeOf(std::sqrt(std::max(squares_[k], 1.0)) / units::TWO_PI, shapes_.col(k), t.stickout / ELEMENTS));
}

HeldMode HeldTool::modeOf(double frequency, const Eigen::VectorXd& shape, double element) const {
  return {frequency, {shape.data(), shape.data() + TOOL}, element};
}

/// Rayleigh's perturbation: with d = v_j' (dK - w_k^2 dM) v_k, w_k^2 grows by d_kk, and v_k mixes with v_j by
/// d_jk / (w_k^2 - w_j^2).
std::vector<HeldMode> HeldTool::modesOf(const ToolInHolder& near) const {
  MatrixXd stiffness, mass;
  assemble(near, stiffness, mass);
  const MatrixXd stiffness_change = shapes_.transpose() * (stiffness - stiffness_) * shapes_;
  const MatrixXd mass_change = shapes_.transpose() * (mass - mass_) * shapes_;
  std::vector<HeldMode> found;
  for (Index k = 0; k < squares_.size(); ++k) {
    Eigen::VectorXd mix(squares_.size());
    for (Index j = 0; j < squares_.size(); ++j) {
      const double apart = squares_[k] - squares_[j];
      mix[j] = j == k                  ? 1.0 - 0.5 * mass_change(k, k)
               : std::abs(apart) > 0.0 ? (stiffness_change(j, k) - squares_[k] * mass_change(j, k)) / apart
                                       : 0.0;
    }
    const double square = squares_[k] + stiffness_change(k, k) - squares_[k] * mass_change(k, k);
    found.push_back(
        modeOf(std::sqrt(std::max(square, 1.0)) / units::TWO_PI, shapes_ * mix, near.stickout / ELEMENTS));
  }
  return found;
}

}  // namespace smartmill::hammer
