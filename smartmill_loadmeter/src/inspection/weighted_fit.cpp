#include "weighted_fit.h"

#include <Eigen/Dense>
#include <boost/math/distributions/chi_squared.hpp>

#include <cmath>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

constexpr double SCATTER = 0.99;     // [1] probability of the chi square that stated deviations explain
constexpr std::size_t SHARE = 4;     // at most one of so many rows is refused
constexpr double UNTESTABLE = 1e-9;  // [1] 1 - leverage of a row that alone determines an unknown

// Residuals of the rows in use.
struct Residuals {
  WeightedFit::Refused worst;  // the deviation is that from the others
  double squares = 0.0;        // [1]
  std::size_t beyond = 0;      // rows above the limit
};

Residuals residualsOf(const Eigen::MatrixXd& design, const Eigen::VectorXd& value,
                      const Eigen::VectorXd& weight, const WeightedFit& fit, double limit) {
  Residuals found;
  for (Eigen::Index i = 0; i < design.rows(); ++i) {
    if (weight[i] == 0.0) continue;
    const double residual = value[i] - design.row(i).dot(fit.value);
    found.squares += weight[i] * residual * residual;
    const double free = 1.0 - weight[i] * design.row(i).dot(fit.covariance * design.row(i).transpose());
    if (free < UNTESTABLE) continue;
    const double sigmas = std::abs(residual) * std::sqrt(weight[i] / free);
    if (sigmas > limit) ++found.beyond;
    if (sigmas > found.worst.sigmas) found.worst = {static_cast<std::size_t>(i), residual / free, sigmas};
  }
  return found;
}

}  // namespace

double widening(double squares, double freedom) {
  if (!(freedom >= 1.0) || squares <= boost::math::quantile(boost::math::chi_squared(freedom), SCATTER))
    return 1.0;
  return std::sqrt(squares / freedom);
}

WeightedFit fitWeighted(const Eigen::MatrixXd& design, const Eigen::VectorXd& value,
                        const Eigen::VectorXd& std_dev, double limit, const std::string& what) {
  WeightedFit fit;
  const auto rows = static_cast<std::size_t>(design.rows()),
             unknowns = static_cast<std::size_t>(design.cols());
  Eigen::VectorXd weight = std_dev.cwiseAbs2().cwiseInverse();
  for (;;) {
    fit.covariance = (design.transpose() * weight.asDiagonal() * design).inverse();
    fit.value = fit.covariance * (design.transpose() * (weight.asDiagonal() * value));
    const Residuals residuals = residualsOf(design, value, weight, fit, limit);
    const std::size_t freedom = rows - fit.refused.size() - unknowns;
    if (residuals.worst.sigmas <= limit) {
      fit.widened = widening(residuals.squares, static_cast<double>(freedom));
      fit.covariance *= fit.widened * fit.widened;
      fit.weight.assign(weight.data(), weight.data() + weight.size());
      return fit;
    }
    if (fit.refused.size() == rows / SHARE || freedom <= 1) {
      fit.problem = formatted(
          "%zu of %zu %s deviate from the others by more than %.1f standard deviations, the largest by "
          "%.1f um; expected at most a quarter: state larger standard deviations or inspect again",
          residuals.beyond + fit.refused.size(), rows, what.c_str(), limit,
          residuals.worst.deviation / units::UM);
      return fit;
    }
    fit.refused.push_back(residuals.worst);
    weight[static_cast<Eigen::Index>(residuals.worst.row)] = 0.0;
  }
}

}  // namespace smartmill::loadmeter
