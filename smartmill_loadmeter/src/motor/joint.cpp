#include "smartmill_loadmeter/motor/joint.h"

#include <cmath>

#include <Eigen/Core>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::loadmeter {

namespace {

// Typical sizes, so that singular values compare.
const std::array<double, 6> UNIT{1e9, 1e9, 1e9, 1e4, 1e4, 1e4};
constexpr double RANK = 1e-7;     // [1] of the largest singular value
constexpr double LEAKAGE = 1e-3;  // [1] share of a coefficient that may lie in what is not seen

}  // namespace

Estimate FeedDrive::opposing(double current) const {
  const double rise = current - air_current;
  return {newton_per_ampere * rise,
          std::hypot(newton_per_ampere_std * rise, newton_per_ampere * current_std)};
}

std::optional<Estimate> axisForce(const FeedDrive& drive, double current, double velocity, double smallest) {
  if (std::abs(velocity) < smallest) return std::nullopt;
  Estimate force = drive.opposing(current);
  if (velocity > 0.0) force.value = -force.value;
  return force;
}

namespace {

// Torques and forces of axes in units of their standard deviations, rows x coefficients in units of UNIT.
struct Observations {
  std::vector<Eigen::Matrix<double, 1, 6>> rows;
  std::vector<double> targets;

  void add(const Eigen::Matrix<double, 1, 6>& row, const Estimate& e) {
    if (!(e.std_dev > 0.0) || !std::isfinite(e.value)) {
      throw Error("joint coefficients: a reading without a standard deviation > 0");
    }
    rows.push_back(row / e.std_dev);
    targets.push_back(e.value / e.std_dev);
  }

  void add(const JointReading& r) {
    const auto map = meanForceMatrix(r.tool, r.engagement);
    std::array<Eigen::Matrix<double, 1, 6>, 4> row;
    for (std::size_t f = 0; f < 4; ++f) {
      for (std::size_t c = 0; c < 6; ++c) row[f][static_cast<Eigen::Index>(c)] = map[f][c] * UNIT[c];
    }
    const double cosine = std::cos(r.heading), sine = std::sin(r.heading);
    if (r.torque) add(row[3], *r.torque);
    if (r.axis_force[0]) add(cosine * row[0] - sine * row[1], *r.axis_force[0]);
    if (r.axis_force[1]) add(sine * row[0] + cosine * row[1], *r.axis_force[1]);
    if (r.axis_force[2]) add(row[2], *r.axis_force[2]);
  }
};

struct JointFit {
  Eigen::Matrix<double, 6, 1> found = Eigen::Matrix<double, 6, 1>::Zero();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> unseen = found;  // squared share of each coefficient that no row tells
};

JointFit solve(const Observations& all) {
  Eigen::MatrixXd a(static_cast<Eigen::Index>(all.rows.size()), 6);
  Eigen::VectorXd b(static_cast<Eigen::Index>(all.rows.size()));
  for (std::size_t i = 0; i < all.rows.size(); ++i) {
    a.row(static_cast<Eigen::Index>(i)) = all.rows[i];
    b[static_cast<Eigen::Index>(i)] = all.targets[i];
  }
  const linear::Svd svd = linear::svd(a, true);
  const Eigen::VectorXd& s = svd.values;
  const Eigen::MatrixXd& v = svd.v;
  JointFit fit;
  Eigen::Index rank = 0;
  for (Eigen::Index k = 0; k < 6; ++k) {
    if (k < s.size() && s[k] > RANK * s[0]) {
      fit.found += v.col(k) * (svd.u.col(k).dot(b) / s[k]);
      fit.covariance += v.col(k) * v.col(k).transpose() / (s[k] * s[k]);
      ++rank;
    } else {
      fit.unseen += v.col(k).cwiseAbs2();
    }
  }
  // Scatter beyond the stated standard deviations widens them.
  const double freedom = static_cast<double>(all.rows.size()) - static_cast<double>(rank);
  if (freedom > 0.0) fit.covariance *= std::max(1.0, (a * fit.found - b).squaredNorm() / freedom);
  return fit;
}

}  // namespace

JointResult identifyJointly(const std::vector<JointReading>& readings) {
  Observations all;
  for (const JointReading& r : readings) all.add(r);
  if (all.rows.empty()) throw Error("joint coefficients: no torque and no moving axis in any reading");
  const JointFit fit = solve(all);
  JointResult result;
  result.value = result.std_dev = NOT_IDENTIFIED;
  result.covariance.fill(NOT_IDENTIFIED.ktc);
  result.readings = static_cast<int>(readings.size());
  std::array<bool, 6> seen{};
  for (std::size_t c = 0; c < 6; ++c) {
    const Eigen::Index i = static_cast<Eigen::Index>(c);
    const CuttingKey& key = cuttingKeys()[c];
    seen[c] = std::sqrt(fit.unseen[i]) < LEAKAGE;
    if (!seen[c]) {
      const std::string name = key.key;
      result.not_observable.push_back(name.substr(0, name.find('_')));
      continue;
    }
    result.value.*key.coefficient = fit.found[i] * UNIT[c];
    result.std_dev.*key.coefficient = std::sqrt(fit.covariance(i, i)) * UNIT[c];
  }
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      if (!seen[i] || !seen[j]) continue;
      result.covariance[6 * i + j] =
          fit.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) * UNIT[i] * UNIT[j];
    }
  }
  if (result.not_observable.size() == 6) {
    throw Error("joint coefficients: the readings separate none of the six (one feed, or too few)");
  }
  return result;
}

}  // namespace smartmill::loadmeter
