#include "fit/campaign_cost.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/fit/bounded_quadratic.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::discrepancy {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<fit::Parameter> CampaignCost::parameters() const {
  const CampaignCoordinates& c = coordinates_;
  std::vector<fit::Parameter> parameters;
  for (const Index k : c.own()) parameters.push_back({c.start()[k], c.low()[k], c.high()[k], 1.0});
  return parameters;
}

std::optional<VectorXd> CampaignCost::pointAt(const VectorXd& own) const {
  const CampaignCoordinates& c = coordinates_;
  VectorXd at = c.start();
  at(c.own()) = own;
  if (!linearisation_.simulate(at)) return {};
  if (simulatesAll()) return at;
  const std::vector<Index>& frozen = c.frozen();
  MatrixXd information = c.frozenTangents().information;
  const VectorXd precision = c.precision()(frozen);
  const VectorXd linearised_at = -c.shiftAt(VectorXd::Zero(at.size()));
  const VectorXd right =
      information * linearised_at - linearisation_.frozenAlong() + precision.cwiseProduct(c.null()(frozen));
  information.diagonal() += precision;
  at(frozen) = fit::minimiseWithin(information, right, c.low()(frozen), c.high()(frozen));
  return at;
}

// Normal equations of the own coordinates; frozen ones that are not at a bound follow their optimum, their
// priors are part of the squares.
CampaignCost::Linear CampaignCost::withFrozenEliminated(const VectorXd& at, const Linear& of_all) const {
  const CampaignCoordinates& c = coordinates_;
  Linear own{of_all.squares + c.frozenPenaltyAt(at), of_all.information(c.own(), c.own()),
             of_all.gradient(c.own())};
  std::vector<Index> free_frozen;
  for (const Index k : c.frozen()) {
    if (at[k] > c.low()[k] && at[k] < c.high()[k]) free_frozen.push_back(k);
  }
  if (free_frozen.empty()) return own;
  MatrixXd information = of_all.information(free_frozen, free_frozen);
  information.diagonal() += c.precision()(free_frozen);
  const MatrixXd coupling = of_all.information(free_frozen, c.own());
  own.information -= coupling.transpose() * linear::solveSymmetric(information, coupling);
  return own;
}

std::optional<VectorXd> CampaignCost::linearOptimumFrom(const VectorXd& at) const {
  const CampaignCoordinates& c = coordinates_;
  const Linear* const here = linearisation_.linearise(at);
  if (!here) return {};
  const VectorXd right = here->information * at - here->gradient + c.precision().cwiseProduct(c.null());
  MatrixXd information = here->information;
  information.diagonal() += c.precision();
  return fit::minimiseWithin(information, right, c.low(), c.high());
}

double CampaignCost::predictedReductionAt(const VectorXd& own) const {
  const CampaignCoordinates& c = coordinates_;
  const std::optional<VectorXd> at = pointAt(own);
  const Linear* of_all = at ? linearisation_.linearise(*at) : nullptr;
  if (!of_all) return 0.0;
  Linear point = withFrozenEliminated(*at, *of_all);
  const VectorXd precision = c.precision()(c.own());
  point.gradient += precision.cwiseProduct(own - c.null()(c.own()));
  point.information.diagonal() += precision;
  std::vector<Index> free_to_move;
  for (Index k = 0; k < own.size(); ++k) {
    const Index i = c.own()[static_cast<std::size_t>(k)];
    const bool pushes_outwards = (own[k] <= c.low()[i] && point.gradient[k] > 0.0) ||
                                 (own[k] >= c.high()[i] && point.gradient[k] < 0.0);
    if (!pushes_outwards) free_to_move.push_back(k);
  }
  const VectorXd gradient = point.gradient(free_to_move);
  const MatrixXd information = point.information(free_to_move, free_to_move);
  return gradient.dot(linear::solveSymmetric(information, gradient));
}

bool CampaignCost::evaluate(const VectorXd& own, VectorXd* residual, MatrixXd* jacobian) const {
  const CampaignCoordinates& c = coordinates_;
  const Index n = own.size();
  VectorXd& r = *residual;
  r.setZero();
  const VectorXd prior_root = c.precision()(c.own()).cwiseSqrt();
  r.tail(n) = prior_root.cwiseProduct(own - c.null()(c.own()));
  const std::optional<VectorXd> at = pointAt(own);
  if (!at) return false;
  if (!jacobian) {
    r[n] = std::sqrt(std::max(linearisation_.squaresAt(*at) + c.frozenPenaltyAt(*at), 0.0));
    return true;
  }
  const Linear* of_all = linearisation_.linearise(*at);
  if (!of_all) return false;
  const Linear point = withFrozenEliminated(*at, *of_all);
  // information = R' R; the residual along the derivatives is R'^-1 gradient.
  const linear::SymmetricRoot root = linear::symmetricRoot(point.information, point.gradient);
  MatrixXd& j = *jacobian;
  j.topRows(n) = root.root;
  r.head(n) = root.along;
  r[n] = std::sqrt(std::max(point.squares - r.head(n).squaredNorm(), 0.0));
  j.bottomRows(n) = prior_root.asDiagonal();
  return true;
}

}  // namespace smartmill::discrepancy
