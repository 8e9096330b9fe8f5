#include "weighted_fit.h"

#include <Eigen/Dense>
#include <boost/math/distributions/chi_squared.hpp>

#include <cmath>

#include "smartmill_core/formatted.h"

namespace smartmill::loadmeter {

namespace {

constexpr double SCATTER = 0.99;     // [1] probability of the chi square that stated deviations explain
constexpr std::size_t SHARE = 4;     // at most one of so many rows is refused
constexpr double UNTESTABLE = 1e-9;  // [1] 1 - leverage of a row that alone determines an unknown

}  // namespace

WeightedFit fitWeighted(const Eigen::MatrixXd& design, const Eigen::VectorXd& value,
                        const Eigen::VectorXd& std_dev, double limit, const std::string& what) {
  WeightedFit fit;
  const Eigen::Index rows = design.rows(), unknowns = design.cols();
  Eigen::VectorXd weight = std_dev.cwiseAbs2().cwiseInverse();
  const std::size_t most = static_cast<std::size_t>(rows) / SHARE;
  Eigen::Index used = rows;
  for (;; --used) {
    fit.covariance = (design.transpose() * weight.asDiagonal() * design).inverse();
    fit.value = fit.covariance * (design.transpose() * (weight.asDiagonal() * value));
    const Eigen::VectorXd residual = value - design * fit.value;
    WeightedFit::Refused worst;
    double squares = 0.0;
    std::size_t beyond = 0;
    for (Eigen::Index i = 0; i < rows; ++i) {
      if (weight[i] == 0.0) continue;
      squares += weight[i] * residual[i] * residual[i];
      const double free = 1.0 - weight[i] * design.row(i) * fit.covariance * design.row(i).transpose();
      if (free < UNTESTABLE) continue;
      const double sigmas = std::abs(residual[i]) * std::sqrt(weight[i] / free);
      if (sigmas > limit) ++beyond;
      if (sigmas > worst.sigmas) worst = {static_cast<std::size_t>(i), residual[i], sigmas};
    }
    if (worst.sigmas > limit) {
      if (fit.refused.size() == most || used == unknowns + 1) {
        fit.problem = formatted(
            "%zu of %zu %s deviate from the others by more than %.1f standard deviations, the largest by "
            "%.1f um; expected at most a quarter: state larger standard deviations or inspect again",
            beyond + fit.refused.size(), static_cast<std::size_t>(rows), what.c_str(), limit,
            1e6 * worst.deviation);
        return fit;
      }
      // The deviation is that from the others.
      const auto i = static_cast<Eigen::Index>(worst.row);
      worst.deviation /= 1.0 - weight[i] * design.row(i) * fit.covariance * design.row(i).transpose();
      fit.refused.push_back(worst);
      weight[i] = 0.0;
      continue;
    }
    const auto freedom = static_cast<double>(used - unknowns);
    if (freedom > 0.0 && squares > boost::math::quantile(boost::math::chi_squared(freedom), SCATTER)) {
      fit.widened = std::sqrt(squares / freedom);
      fit.covariance *= squares / freedom;
    }
    break;
  }
  fit.weight.assign(weight.data(), weight.data() + rows);
  return fit;
}

}  // namespace smartmill::loadmeter
