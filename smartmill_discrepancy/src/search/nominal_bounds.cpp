#include "search/nominal_bounds.h"

#include <algorithm>

#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::discrepancy {

using Eigen::Index;

Eigen::MatrixXd NominalBounds::fixedAt(const std::vector<Index>& at_bounds,
                                       Eigen::MatrixXd information) const {
  for (const Index c : at_bounds) {
    information.row(c).setZero();
    information.col(c).setZero();
    information(c, c) = prior_[c];
  }
  return information;
}

ConstrainedStep NominalBounds::solve(const Eigen::MatrixXd& information, const Eigen::VectorXd& right) const {
  constexpr double TOLERANCE = 0.01;  // standard deviations: rounding of a solution at its bound
  ConstrainedStep step;
  Eigen::VectorXd at_bound = Eigen::VectorXd::Zero(right.size());
  for (;;) {
    Eigen::VectorXd score = right - information * at_bound;
    for (const Index c : step.at_bounds) score[c] = 0.0;
    step.by = linear::solveSymmetric(fixedAt(step.at_bounds, information), score) + at_bound;
    double worst = TOLERANCE;
    Index which = -1;
    for (std::size_t k = 0; k < freedom_.size(); ++k) {
      const auto c = static_cast<Index>(k);
      if (std::find(step.at_bounds.begin(), step.at_bounds.end(), c) != step.at_bounds.end()) continue;
      const double to = nominal_[k] + step.by[c];
      const double beyond = std::max(freedom_[k].low - to, to - freedom_[k].high) / freedom_[k].prior_std;
      if (beyond <= worst) continue;
      worst = beyond;
      which = c;
    }
    if (which < 0) return step;
    const Coordinate& over = freedom_[static_cast<std::size_t>(which)];
    const double at = nominal_[static_cast<std::size_t>(which)];
    at_bound[which] = (step.by[which] > 0.0 ? over.high : over.low) - at;
    step.at_bounds.push_back(which);
  }
}

}  // namespace smartmill::discrepancy
