#include "smartmill_loadmeter/identification/test_information.h"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

// Unknowns Ktc, Kte, Coulomb [N m] and viscous [N m s/rad] friction, scaled to similar magnitudes.
using Information = Eigen::Matrix4d;
const Eigen::Vector4d SCALE{1e9, 1e4, 0.1, 1e-3};

bool isCut(const CuttingCondition& test) {
  return test.kind == CuttingCondition::Kind::cut;
}

// Variance of a mean torque [N2 m2] (eq. 3.12).
double varianceOf(double speed, const Spindle& spindle, double voltage_std) {
  return std::pow(voltage_std / (spindle.load_meter_gain * speed), 2);
}

void add(const CuttingCondition& test, const Spindle& spindle, double voltage_std, Information* information) {
  Eigen::Vector4d row{0.0, 0.0, 1.0, test.spindle_speed};
  if (isCut(test)) {
    const auto map = meanForceMatrix(test.tool, test.engagement);
    row[0] = map[3][0];
    row[1] = map[3][3];
  }
  row = row.cwiseProduct(SCALE);
  *information += row * row.transpose() / varianceOf(test.spindle_speed, spindle, voltage_std);
}

void add(const TorqueCovariance& prior, Information* information) {
  if (!std::isfinite(prior.tc) || !std::isfinite(prior.te)) return;
  Eigen::Matrix2d covariance;
  covariance << prior.tc, prior.tc_te, prior.tc_te, prior.te;
  const Eigen::Vector2d unscale = SCALE.head<2>().cwiseInverse();
  covariance = unscale.asDiagonal() * covariance * unscale.asDiagonal();
  information->topLeftCorner<2, 2>() += covariance.inverse();
}

TorqueCovariance covarianceOf(const Information& information) {
  const double unknown = std::numeric_limits<double>::infinity();
  const Eigen::SelfAdjointEigenSolver<Information> eigen(information);
  if (!(eigen.eigenvalues()[0] > 1e-12 * eigen.eigenvalues()[3])) return {unknown, 0.0, unknown};
  const Information c = information.inverse();
  return {c(0, 0) * SCALE[0] * SCALE[0], c(0, 1) * SCALE[0] * SCALE[1], c(1, 1) * SCALE[1] * SCALE[1]};
}

// Whether these tests determine friction and both coefficients by themselves.
bool isComplete(const std::vector<CuttingCondition>& tests) {
  std::set<double> speeds, feeds;
  for (const CuttingCondition& t : tests) {
    if (isCut(t)) {
      feeds.insert(t.engagement.feed_per_tooth);
    } else {
      speeds.insert(t.spindle_speed);
    }
  }
  return speeds.size() >= 2 && feeds.size() >= 2;
}

// Whether air cuts at most as fast, and at least as fast, exist for every cut for which the plan has them:
// friction is not extrapolated.
bool enclosesCuts(const std::vector<CuttingCondition>& tests, const std::vector<CuttingCondition>& plan) {
  const auto hasAir = [](const std::vector<CuttingCondition>& of, double speed, bool above) {
    return std::any_of(of.begin(), of.end(), [&](const CuttingCondition& t) {
      return !isCut(t) && (above ? t.spindle_speed >= speed : t.spindle_speed <= speed);
    });
  };
  return std::all_of(tests.begin(), tests.end(), [&](const CuttingCondition& t) {
    const double speed = t.spindle_speed;
    return !isCut(t) || ((hasAir(tests, speed, false) || !hasAir(plan, speed, false)) &&
                         (hasAir(tests, speed, true) || !hasAir(plan, speed, true)));
  });
}

std::array<double, 3> between(double low, double high) {
  return {low, 0.5 * (low + high), high};
}

std::vector<CuttingCondition> select(const std::vector<CuttingCondition>& tests,
                                     const std::vector<std::size_t>& indices) {
  std::vector<CuttingCondition> selected;
  for (const std::size_t i : indices) selected.push_back(tests[i]);
  return selected;
}

}  // namespace

TorqueCovariance expectedCovariance(const std::vector<CuttingCondition>& tests, const Spindle& spindle,
                                    const TorqueCovariance* prior, double voltage_std) {
  Information information = Information::Zero();
  if (prior) add(*prior, &information);
  for (const CuttingCondition& test : tests) add(test, spindle, voltage_std, &information);
  return covarianceOf(information);
}

std::vector<std::size_t> neededTests(const std::vector<CuttingCondition>& tests, const Spindle& spindle,
                                     const TorqueCovariance& knowledge, double voltage_std) {
  std::vector<std::size_t> needed(tests.size());
  std::iota(needed.begin(), needed.end(), 0);
  const TorqueCovariance target = expectedCovariance(tests, spindle, nullptr, voltage_std);
  // Drops one by one the test that is missed least.
  for (;;) {
    double best = std::numeric_limits<double>::infinity();
    std::vector<std::size_t> fewer;
    for (std::size_t drop = 0; drop < needed.size(); ++drop) {
      std::vector<std::size_t> rest = needed;
      rest.erase(rest.begin() + static_cast<std::ptrdiff_t>(drop));
      const std::vector<CuttingCondition> left = select(tests, rest);
      if (!isComplete(left) || !enclosesCuts(left, tests)) continue;
      const TorqueCovariance with = expectedCovariance(left, spindle, &knowledge, voltage_std);
      const double cost = std::max(with.tc / target.tc, with.te / target.te);
      if (cost < best) best = cost, fewer = rest;
    }
    if (!(best <= 1.0)) return needed;
    needed = fewer;
  }
}

std::optional<SuggestedCut> mostInformativeCut(const ToolGeometry& tool, const Spindle& spindle,
                                               const CuttingCoefficients& value,
                                               const TorqueCovariance& knowledge,
                                               const SuggestionLimits& limits, double voltage_std) {
  const std::array<std::array<double, 2>, 3> immersions{
      {{0.0, units::PI}, {0.0, 0.5 * units::PI}, {0.5 * units::PI, units::PI}}};  // slot, up, down
  std::optional<SuggestedCut> best;
  double smallest = std::numeric_limits<double>::infinity();
  for (const double speed : between(limits.slowest, limits.fastest)) {
    for (const auto& [entry, exit] : immersions) {
      for (const double feed : between(limits.least_feed, limits.most_feed)) {
        for (const double depth : between(limits.least_depth, limits.most_depth)) {
          SuggestedCut cut;
          cut.speed = speed;
          cut.engagement = {entry, exit, depth, feed};
          const auto map = meanForceMatrix(tool, cut.engagement);
          cut.torque = map[3][0] * value.ktc + map[3][3] * value.kte;
          if (limits.torque > 0.0 && cut.torque > limits.torque) continue;
          if (limits.power > 0.0 && cut.torque * speed > limits.power) continue;
          // Friction is measured in air at the same speed, which doubles the variance.
          Information information = Information::Identity();  // friction is not estimated
          information.topLeftCorner<2, 2>().setZero();
          add(knowledge, &information);
          const Eigen::Vector2d row = Eigen::Vector2d{map[3][0], map[3][3]}.cwiseProduct(SCALE.head<2>());
          information.topLeftCorner<2, 2>() +=
              row * row.transpose() / (2.0 * varianceOf(speed, spindle, voltage_std));
          const TorqueCovariance after = covarianceOf(information);
          const double sum = after.tc / (value.ktc * value.ktc) + after.te / (value.kte * value.kte);
          if (!(sum < smallest)) continue;
          smallest = sum;
          cut.ktc_std = std::sqrt(after.tc);
          cut.kte_std = std::sqrt(after.te);
          best = cut;
        }
      }
    }
  }
  return best;
}

}  // namespace smartmill::loadmeter
