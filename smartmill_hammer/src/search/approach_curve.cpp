#include "smartmill_hammer/search/approach_curve.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>

#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::hammer {

bool ApproachCurve::isClipped(double volt) const {
  return std::abs(volt) >= options_.range_share * options_.range_volt;
}

double ApproachCurve::nominalGap(double volt) const {
  return options_.gap_at_zero_volt / std::max(1e-3, 1.0 + volt / options_.gain_volt);
}

double ApproachCurve::localGap() const {
  const double far = std::numeric_limits<double>::infinity();
  const std::size_t n = samples_.size();
  if (n < 3) return far;
  const Sample &a = samples_[n - 3], &b = samples_[n - 2], &c = samples_[n - 1];
  if (isClipped(a.volt) ||
      !(b.position - a.position >= options_.least_slope && c.position - b.position >= options_.least_slope))
    return far;
  const double before = (b.volt - a.volt) / (b.position - a.position),
               now = (c.volt - b.volt) / (c.position - b.position);
  if (!(before > 0.0 && now > options_.clear_rise * before)) return far;
  const double between = 0.5 * (c.position - a.position), middle = between / (std::sqrt(now / before) - 1.0);
  const double gap = middle - 0.5 * (c.position - b.position);
  return gap < options_.sharp * nominalGap(c.volt) ? gap : far;
}

ApproachCurve::Hyperbola ApproachCurve::hyperbola(double volt_std) const {
  if (options_.curve_jog > 2.0 * options_.check_jog)
    return within(options_.curve_reach * options_.curve_jog, volt_std);
  Hyperbola found = within(options_.gap_at_zero_volt, volt_std);
  for (int k = 0; k < options_.curve_rounds && std::isfinite(found.gap); ++k) {
    const Hyperbola nearer = within(std::max(found.gap, 2.0 * options_.check_jog), volt_std);
    if (!std::isfinite(nearer.gap)) break;
    found = nearer;
  }
  return found;
}

/// Over the samples within `reach` [m]; NaN: undetermined.
ApproachCurve::Hyperbola ApproachCurve::within(double reach, double volt_std) const {
  std::vector<Sample> near;
  double furthest = 0.0;
  for (const Sample& r : samples_) {
    const double away = std::abs(r.position - position());
    if (isClipped(r.volt) || away > reach) continue;
    near.push_back(r);
    furthest = std::max(furthest, away);
  }
  Hyperbola found = fitHyperbola(near, volt_std);
  const double share = found.gap / options_.gap_at_zero_volt;
  if (furthest < options_.least_reach * reach || !(share > options_.least_bend && share < options_.most_bend))
    found.gap = found.gap_std = std::numeric_limits<double>::quiet_NaN();
  return found;
}

std::optional<SensorCurve> ApproachCurve::curve(double volt_std) const {
  std::vector<Sample> all;
  double nearest = -std::numeric_limits<double>::infinity(), furthest = -nearest;
  for (const Sample& r : samples_) {
    if (isClipped(r.volt)) continue;
    all.push_back(r);
    nearest = std::max(nearest, r.position);
    furthest = std::min(furthest, r.position);
  }
  if (all.size() < options_.least_readings || nearest - furthest < options_.gap_at_zero_volt) {
    return std::nullopt;
  }
  const Hyperbola h = fitHyperbola(all, volt_std);
  if (!(h.gap > 0.0 && h.constant > 0.0 && h.far_volt_std < options_.known_far * options_.gain_volt))
    return std::nullopt;
  return SensorCurve{h.far_volt, h.constant};
}

/// Least squares of V x = g V + a x + c, so that V = a + K / (g - x) with K = -c - a g; NaN: undetermined.
ApproachCurve::Hyperbola ApproachCurve::fitHyperbola(const std::vector<Sample>& near, double volt_std) const {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Hyperbola none{nan, nan, nan, nan, nan};
  if (near.size() < options_.least_readings) return none;
  const auto rows = static_cast<Eigen::Index>(near.size());
  Eigen::MatrixXd a(rows, 3), b(rows, 1);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Sample& r = near[static_cast<std::size_t>(i)];
    const double x = (r.position - position()) / options_.gap_at_zero_volt, v = r.volt / options_.range_volt;
    a.row(i) << v, x, 1.0;
    b(i, 0) = v * x;
  }
  const linear::LeastSquares fit = linear::leastSquares(a, b);
  if (fit.rank < 3) return none;
  const double gap = fit.x(0, 0), far = fit.x(1, 0);
  // Errors of each row: of position (a distance has two ends), of voltage, and of the law.
  const Eigen::MatrixXd influence =
      linear::inverseSymmetric(Eigen::MatrixXd(a.transpose() * a)) * a.transpose();
  const double position_error = options_.position_std / std::sqrt(2.0) / options_.gap_at_zero_volt;
  const double volt_error = volt_std / options_.range_volt;
  double variance[2] = {0.0, 0.0}, squares = 0.0, expected = 0.0;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double error = std::hypot((a(i, 0) - far) * position_error, (a(i, 1) - gap) * volt_error);
    const double residual = b(i, 0) - a.row(i).dot(fit.x.col(0));
    for (Eigen::Index k = 0; k < 2; ++k) variance[k] += std::pow(influence(k, i) * error, 2);
    squares += residual * residual;
    expected += error * error * static_cast<double>(rows - 3) / static_cast<double>(rows);
  }
  const double misfit = expected > 0.0 ? std::max(1.0, squares / expected) : 1.0;
  return {gap * options_.gap_at_zero_volt, std::sqrt(variance[0] * misfit) * options_.gap_at_zero_volt,
          far * options_.range_volt, std::sqrt(variance[1] * misfit) * options_.range_volt,
          -(fit.x(2, 0) + far * gap) * options_.range_volt * options_.gap_at_zero_volt};
}

}  // namespace smartmill::hammer
