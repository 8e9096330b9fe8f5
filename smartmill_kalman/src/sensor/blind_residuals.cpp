#include "blind_residuals.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace smartmill::kalman {
namespace {

constexpr double MIN_SHARE = 1e-12;  // of the mean power: lower bound of expected and measured power

}  // namespace

double PowerLines::mean() const {
  return std::accumulate(power.begin(), power.end(), 0.0) / static_cast<double>(power.size());
}

double resonance(double f, double f0, double zeta) {
  const double r = f / f0;
  return 1.0 / ((1.0 - r * r) * (1.0 - r * r) + 4.0 * zeta * zeta * r * r);
}

ExpectedPower expectedPower(double f, const Eigen::VectorXd& at, double unit) {
  const double f0 = std::exp(at[0]), zeta = std::exp(at[1]), share = unit * at[2];
  const double r2 = f / f0 * (f / f0), shape = resonance(f, f0, zeta);
  ExpectedPower expected;
  expected.value = std::max(share * shape + unit * at[3], MIN_SHARE * unit);
  // shape = 1 / d, d = (1 - r^2)^2 + 4 zeta^2 r^2; r^2 falls by 2 r^2 a unit of log f0.
  expected.slope[0] = share * shape * shape * 2.0 * r2 * (4.0 * zeta * zeta - 2.0 * (1.0 - r2));
  expected.slope[1] = -share * shape * shape * 8.0 * zeta * zeta * r2;
  expected.slope[2] = unit * shape;
  expected.slope[3] = unit;
  return expected;
}

bool BlindResiduals::evaluate(const Eigen::VectorXd& at, Eigen::VectorXd* residual,
                              Eigen::MatrixXd* jacobian) const {
  for (std::size_t k = 0; k < lines_.power.size(); ++k) {
    const auto row = static_cast<Eigen::Index>(k);
    const ExpectedPower expected = expectedPower(lines_.frequency[k], at, unit_);
    const double x = std::max(lines_.power[k], MIN_SHARE * unit_) / expected.value, over = x - 1.0;
    // sign(x - 1) sqrt(2 (x - 1 - log x)), and its slope over the logarithm of the expected power: -(x - 1) /
    // r.
    double r = over * (1.0 - over / 3.0), slope = -1.0 - over / 3.0;
    if (std::abs(over) > 1e-4) {
      r = std::copysign(std::sqrt(2.0 * (over - std::log(x))), over);
      slope = -over / r;
    }
    (*residual)[row] = r;
    if (!jacobian) continue;
    for (Eigen::Index i = 0; i < 4; ++i) (*jacobian)(row, i) = slope * expected.slope[i] / expected.value;
  }
  return true;
}

}  // namespace smartmill::kalman
