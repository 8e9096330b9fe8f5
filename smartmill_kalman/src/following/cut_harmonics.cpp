#include "cut_harmonics.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/cutting/rigid_cut.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {

using Complex = std::complex<double>;

Basis harmonicsOf(const ToolGeometry& tool, const Engagement& engagement, const std::vector<double>& radius) {
  const double chip = 1.0 / engagement.feed_per_tooth;
  Basis result;
  for (std::size_t direction = 0; direction < 2; ++direction) {
    CuttingLaw law;
    if (direction == 0) {
      law.coefficients.ktc = chip, law.coefficients.kte = 1.0;
    } else {
      law.coefficients.krc = chip, law.coefficients.kre = 1.0;
    }
    const RigidCut cut(tool, law, engagement, radius);
    std::array<std::array<std::vector<double>, 2>, 2> force;  // of chip and edge, x and y
    for (std::size_t i = 0; i < REVOLUTION_POINTS; ++i) {
      const auto parts = cut.termsAt(units::TWO_PI * static_cast<double>(i) / REVOLUTION_POINTS);
      for (std::size_t part = 0; part < 2; ++part) {
        force[part][0].push_back(parts[part].fx);
        force[part][1].push_back(parts[part].fy);
      }
    }
    for (std::size_t part = 0; part < 2; ++part) {
      for (std::size_t axis = 0; axis < 2; ++axis) {
        auto& harmonics = result[2 * part + direction][axis];
        harmonics = fourier(force[part][axis]);
        for (Complex& value : harmonics) value *= 2.0 / REVOLUTION_POINTS;
        harmonics[0] *= 0.5;
      }
    }
  }
  return result;
}

Eigen::VectorXd leastSquares(const Eigen::MatrixXd& columns, const Eigen::VectorXd& target, double stiffer) {
  Eigen::MatrixXd normal = columns.transpose() * columns;
  normal.diagonal().array() *= 1.0 + stiffer;
  return linear::solveSymmetric(normal, Eigen::VectorXd(columns.transpose() * target));
}

WeightedHarmonics::WeightedHarmonics(const ModeFollower::Harmonics& measured, std::size_t count,
                                     double noise_std, double misfit, const Sensor& now, double spindle_speed)
    : count_(count), spindle_frequency_(spindle_speed / units::TWO_PI), weight_(rows()), target_(rows()) {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    // The error of the force model passes the sensor too.
    double largest = 0.0;
    for (std::size_t n = 0; n < count_; ++n) {
      const double passed = std::abs(now[axis].response(frequency(n)));
      largest = std::max(largest, std::abs(measured[axis][n]) / std::max(1.0, passed));
    }
    for (std::size_t n = 0; n < count_; ++n) {
      const double passed = std::abs(now[axis].response(frequency(n)));
      const double missed = misfit * std::max(0.1 * passed * largest, std::abs(measured[axis][n]));
      const Eigen::Index row = rowOf(axis, n);
      weight_(row) = weight_(row + 1) = 1.0 / std::hypot(noise_std, missed);
      target_(row) = measured[axis][n].real();
      target_(row + 1) = measured[axis][n].imag();
    }
  }
  target_.array() *= weight_.array();
}

Eigen::MatrixXd WeightedHarmonics::outputOf(const Sensor& sensor, const Basis& basis) const {
  Eigen::MatrixXd columns(rows(), static_cast<Eigen::Index>(TERMS));
  for (std::size_t term = 0; term < TERMS; ++term)
    columns.col(static_cast<Eigen::Index>(term)) =
        outputOf(sensor, [&](std::size_t axis, std::size_t n) { return basis[term][axis][n]; });
  return columns;
}

Eigen::VectorXd WeightedHarmonics::hidden(std::size_t axis, const Mode& mode, const Sensor& sensor,
                                          const Basis& basis) const {
  const Eigen::VectorXd x = leastSquares(outputOf(sensor, basis), target_, 1e-10);
  Sensor only;
  only[axis].modes = {mode};
  only[axis].direct = -mode.gain;
  return outputOf(only, basis) * x;
}

Eigen::VectorXd WeightedHarmonics::innovations(const Sensor& sensor, const Basis& basis) const {
  const Eigen::MatrixXd columns = outputOf(sensor, basis);
  return target_ - columns * leastSquares(columns, target_, 1e-10);
}

std::vector<double> firstRadii(const WeightedHarmonics& measured, const Sensor& now, const ToolGeometry& tool,
                               const Engagement& engagement) {
  std::vector<double> radius(static_cast<std::size_t>(tool.teeth), 0.0);
  ToolGeometry one = tool;
  one.teeth = 1;
  one.pitch.clear();
  const Basis tooth = harmonicsOf(one, engagement, {0.0});
  const Eigen::MatrixXd even = measured.outputOf(now, harmonicsOf(tool, engagement, radius));
  const Eigen::VectorXd x = leastSquares(even, measured.target(), 0.0);
  Eigen::MatrixXd teeth(measured.rows(), tool.teeth);
  for (int k = 0; k < tool.teeth; ++k) {
    teeth.col(k) = measured.outputOf(now, [&](std::size_t axis, std::size_t n) {
      const Complex turned = std::polar(1.0, static_cast<double>(n) * tool.toothAngle(k));
      return turned * (x(0) * tooth[2][axis][n] + x(1) * tooth[3][axis][n]) / engagement.feed_per_tooth;
    });
  }
  const Eigen::VectorXd thicker = leastSquares(teeth, measured.target() - even * x, 1e-6);  // [m]
  for (Eigen::Index k = 0; k + 1 < tool.teeth; ++k) {
    // Tooth k cuts the surface of tooth k + 1.
    const double limit = 0.5 * engagement.feed_per_tooth;
    radius[static_cast<std::size_t>(k + 1)] =
        radius[static_cast<std::size_t>(k)] - std::clamp(thicker(k) - thicker.mean(), -limit, limit);
  }
  return radius;
}

}  // namespace smartmill::kalman
