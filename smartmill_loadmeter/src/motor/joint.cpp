#include "smartmill_loadmeter/motor/joint.h"

#include <cmath>

#include <Eigen/Core>

#include "cut_mechanics.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

namespace {

// Typical values that scale the singular values.
const std::array<double, 6> UNIT{1e9, 1e9, 1e9, 1e4, 1e4, 1e4};
constexpr double LEAST_SINGULAR_VALUE = 1e-7;  // [1] smallest singular value over the largest
constexpr double LARGEST_NULL_SPACE_SHARE =
    1e-3;  // [1] largest share of an observable coefficient in the null space

constexpr Eigen::Index SIZE = 7;  // coefficients, and the gain of the forces in units of its error
using Row = Eigen::Matrix<double, 1, SIZE>;
using Square = Eigen::Matrix<double, SIZE, SIZE>;
using Vector = Eigen::Matrix<double, SIZE, 1>;

// Torques and axis forces over their standard deviations; rows x unknowns in units of UNIT.
struct Observations {
  explicit Observations(double error_of_gain) : gain_error(error_of_gain) {
    if (gain_error == 0.0) return;
    rows.emplace_back(Row::Unit(SIZE - 1));
    targets.push_back(0.0);
  }
  double gain_error;
  std::vector<Row> rows;
  std::vector<double> targets;

  void add(const Eigen::Matrix<double, 1, 6>& row, const Estimate& e, double gain_share) {
    if (!(e.std_dev > 0.0) || !std::isfinite(e.value)) {
      throw Error(
          "joint coefficients: expected measurements with a finite value and a standard deviation > 0");
    }
    rows.emplace_back();
    rows.back() << row / e.std_dev, gain_share * e.value / e.std_dev;
    targets.push_back(e.value / e.std_dev);
  }

  void add(const JointMeasurement& r) {
    const auto map = meanForceMatrix(r.tool, r.engagement);
    std::array<Eigen::Matrix<double, 1, 6>, 4> row;
    for (std::size_t f = 0; f < 4; ++f) {
      for (std::size_t c = 0; c < 6; ++c) row[f][static_cast<Eigen::Index>(c)] = map[f][c] * UNIT[c];
    }
    const Eigen::Matrix3d turn = feedFrame(r.tool, r.heading);
    if (r.torque) add(row[3], *r.torque, 0.0);
    for (std::size_t a = 0; a < 3; ++a) {
      const auto i = static_cast<Eigen::Index>(a);
      if (r.axis_force[a])
        add(turn(i, 0) * row[0] + turn(i, 1) * row[1] + turn(i, 2) * row[2], *r.axis_force[a], gain_error);
    }
  }
};

struct JointFitResult {
  Vector found = Vector::Zero();
  Square covariance = Square::Zero();
  Vector null_space_share = found;  // squared share of each coefficient in the null space
};

JointFitResult solve(const Observations& all) {
  Eigen::MatrixXd a(static_cast<Eigen::Index>(all.rows.size()), SIZE);
  Eigen::VectorXd b(static_cast<Eigen::Index>(all.rows.size()));
  for (std::size_t i = 0; i < all.rows.size(); ++i) {
    a.row(static_cast<Eigen::Index>(i)) = all.rows[i];
    b[static_cast<Eigen::Index>(i)] = all.targets[i];
  }
  const linear::Svd svd = linear::svd(a, true);
  const Eigen::VectorXd& s = svd.values;
  const Eigen::MatrixXd& v = svd.v;
  JointFitResult fit;
  Eigen::Index rank = 0;
  for (Eigen::Index k = 0; k < SIZE; ++k) {
    if (k < s.size() && s[k] > LEAST_SINGULAR_VALUE * s[0]) {
      fit.found += v.col(k) * (svd.u.col(k).dot(b) / s[k]);
      fit.covariance += v.col(k) * v.col(k).transpose() / (s[k] * s[k]);
      ++rank;
    } else {
      fit.null_space_share += v.col(k).cwiseAbs2();
    }
  }
  // Scatter beyond the stated standard deviations increases the covariance.
  const double freedom = static_cast<double>(all.rows.size()) - static_cast<double>(rank);
  if (freedom > 0.0) fit.covariance *= std::max(1.0, (a * fit.found - b).squaredNorm() / freedom);
  return fit;
}

}  // namespace

JointResult identifyJointly(const std::vector<JointMeasurement>& measurements, double gain_error) {
  Observations all(gain_error);
  const std::size_t known = all.rows.size();
  for (const JointMeasurement& r : measurements) all.add(r);
  if (all.rows.size() == known)
    throw Error("joint coefficients: no measurement with a torque or a moving axis");
  const JointFitResult fit = solve(all);
  JointResult result;
  result.value = result.std_dev = NOT_IDENTIFIED;
  result.covariance.fill(NOT_IDENTIFIED.ktc);
  result.measurements = static_cast<int>(measurements.size());
  std::array<bool, 6> is_observable{};
  for (std::size_t c = 0; c < 6; ++c) {
    const Eigen::Index i = static_cast<Eigen::Index>(c);
    const CuttingKey& key = cuttingKeys()[c];
    is_observable[c] = std::sqrt(fit.null_space_share[i]) < LARGEST_NULL_SPACE_SHARE;
    if (!is_observable[c]) {
      const std::string name = key.key;
      result.not_observable.push_back(name.substr(0, name.find('_')));
      continue;
    }
    result.value.*key.coefficient = fit.found[i] * UNIT[c];
    result.std_dev.*key.coefficient = std::sqrt(fit.covariance(i, i)) * UNIT[c];
  }
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      if (!is_observable[i] || !is_observable[j]) continue;
      result.covariance[6 * i + j] =
          fit.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) * UNIT[i] * UNIT[j];
    }
  }
  if (result.not_observable.size() == 6) {
    throw Error("joint coefficients: none of the six is observable (one feed only, or too few cuts)");
  }
  return result;
}

}  // namespace smartmill::loadmeter
