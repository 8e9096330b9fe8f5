#include "fit/campaign_cost.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fit/tangent.h"
#include "smartmill_core/error.h"
#include "smartmill_core/fit/bounded_quadratic.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::discrepancy {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Values = std::vector<double>;

bool same(const std::optional<VectorXd>& a, const VectorXd& b) {
  return a && *a == b;
}

}  // namespace

CampaignCost::CampaignCost(const Fitter& fitter, const FitState& start, const NominalTangents* frozen,
                           const FitOptions& options)
    : fitter_(fitter), start_(start), frozen_(frozen), prior_weight_(options.prior_weight) {
  if (options.nominal_free) coordinates_ = fitter.freedom().coordinates();
  nominal_ = coordinates_.size();
  for (const Member& m : start.members)
    coordinates_.insert(coordinates_.end(), m.hypothesis->coordinates.begin(),
                        m.hypothesis->coordinates.end());
  const bool nominal_frozen = frozen_ && !frozen_->at.empty();
  if (nominal_frozen && !options.nominal_free)
    throw Error("fit: tangents of nominal values that are not free");
  if (frozen_) addTurns();
  const std::size_t own_begin = nominal_frozen ? nominal_ : 0;
  for (std::size_t c = 0; c < coordinates_.size(); ++c)
    (c < own_begin || c >= turnsBegin() ? frozen_places_ : own_places_).push_back(static_cast<Index>(c));
  setPoints();
}

void CampaignCost::setPoints() {
  Values start(start_.nominal.begin(), start_.nominal.begin() + static_cast<std::ptrdiff_t>(nominal_));
  for (const Member& m : start_.members) start.insert(start.end(), m.values.begin(), m.values.end());
  if (turns_ > 0) start.insert(start.end(), start_.turns.begin(), start_.turns.end());
  const auto all = static_cast<Index>(coordinates_.size());
  for (VectorXd* of : {&start_point_, &low_, &high_, &precision_, &null_}) of->resize(all);
  for (Index c = 0; c < all; ++c) {
    const auto k = static_cast<std::size_t>(c);
    low_[c] = coordinates_[k].low;
    high_[c] = coordinates_[k].high;
    precision_[c] = prior_weight_ / (coordinates_[k].prior_std * coordinates_[k].prior_std);
    null_[c] = coordinates_[k].null;
    start_point_[c] = std::clamp(start[k], low_[c], high_[c]);
  }
}

// No further from where the tangents were taken than they are worth something.
void CampaignCost::addTurns() {
  constexpr double REACH = 0.05;  // [rad]
  turns_ = frozen_->turns.size();
  start_.turns.resize(turns_, 0.0);
  for (std::size_t k = 0; k < turns_; ++k) {
    const TurnFreedom& free = fitter_.turns()[k].freedom;
    const bool entry = free.value == &Turn::entry;
    const double at = frozen_->turns[k], reach = entry ? 1.0 : REACH;
    start_.turns[k] = std::clamp(start_.turns[k], at - reach, at + reach);
    coordinates_.push_back({"turn", entry ? 0.0 : at, at - reach, at + reach, 0.0, free.prior_std});
  }
}

std::vector<fit::Parameter> CampaignCost::parameters() const {
  std::vector<fit::Parameter> parameters;
  for (const Index c : own_places_) parameters.push_back({start_point_[c], low_[c], high_[c], 1.0});
  return parameters;
}

FitState CampaignCost::stateAt(const VectorXd& at) const {
  FitState state = start_;
  std::copy(at.data(), at.data() + nominal_, state.nominal.begin());
  const double* next = at.data() + nominal_;
  for (Member& m : state.members) {
    std::copy(next, next + m.values.size(), m.values.begin());
    next += m.values.size();
  }
  std::copy(next, next + turns_, state.turns.begin());
  return state;
}

MachineModel CampaignCost::modelAt(const VectorXd& at) const {
  FitState state = stateAt(at);
  if (frozen_ && !frozen_->at.empty()) state.nominal = frozen_->at;
  return fitter_.model(state);
}

VectorXd CampaignCost::ownOf(const VectorXd& at) const {
  return at(own_places_);
}

// Blocks that are what they were leave what is known of them.
void CampaignCost::compare(SimulatedBlocks simulated) const {
  const TwinRunner& runner = fitter_.runner();
  const std::vector<Block>& blocks = runner.blocks();
  const auto count = static_cast<Index>(blocks.size());
  const Index frozen = frozen_places_.empty() ? 0 : frozen_->columns.cols();
  const bool first = simulated_.empty();
  if (first) {
    apart_.resize(static_cast<Index>(runner.size()));
    block_squares_.resize(count);
    block_along_.resize(frozen, count);
  }
  runParallel(blocks.size(), runner.threads(), [&](std::size_t block) {
    if (!first && simulated[block] == simulated_[block]) return;
    const auto b = static_cast<Index>(block);
    auto segment =
        apart_.segment(static_cast<Index>(blocks[block].offset), static_cast<Index>(blocks[block].size));
    runner.compare(simulated, block, segment.data());
    block_squares_[b] = segment.squaredNorm();
    if (frozen > 0) block_along_.col(b) = frozen_->columns.along(block, apart_);
  });
  simulated_ = std::move(simulated);
  apart_squares_ = block_squares_.sum();
  if (frozen > 0) frozen_along_ = block_along_.rowwise().sum();
}

// @return false where the twin refuses or gives no numbers
bool CampaignCost::simulate(const VectorXd& at) const {
  const VectorXd own = ownOf(at);
  if (same(simulated_at_, own)) return std::isfinite(apart_squares_);
  try {
    compare(std::move(fitter_.runner().simulateBlocks({modelAt(at)}).front()));
  } catch (const Error&) {
    return false;  // a point that the twin refuses is no better point
  }
  simulated_at_ = own;
  return std::isfinite(apart_squares_);
}

// Columns along what is not frozen, and their products. simulate() stands at the point.
bool CampaignCost::takeTangents(const VectorXd& at) const {
  const VectorXd here = ownOf(at);
  if (same(tangents_at_, here)) return true;
  tangents_at_.reset();
  std::vector<MachineModel> models;
  Values step;
  for (const Index c : own_places_) {
    const Coordinate& k = coordinates_[static_cast<std::size_t>(c)];
    step.push_back(TANGENT * (at[c] + k.step > k.high ? -k.step : k.step));
    VectorXd moved = at;
    moved[c] += step.back();
    models.push_back(modelAt(moved));
  }
  try {
    own_columns_ = BlockColumns(fitter_.runner(), simulated_, fitter_.runner().simulateBlocks(models), step);
  } catch (const Error&) {
    return false;
  }
  if (!own_columns_.allFinite()) return false;
  own_gram_ = own_columns_.gram();
  own_along_ = own_columns_.along(apart_);
  if (!frozen_places_.empty()) frozen_own_ = frozen_->columns.cross(own_columns_);
  tangents_at_ = here;
  return true;
}

// Of what is frozen from where its tangents were taken.
VectorXd CampaignCost::shiftAt(const VectorXd& at) const {
  VectorXd shift(static_cast<Index>(frozen_places_.size()));
  const std::size_t turns_begin = frozen_places_.size() - turns_;
  for (std::size_t k = 0; k < frozen_places_.size(); ++k) {
    const double from = k < turns_begin ? frozen_->at[k] : frozen_->turns[k - turns_begin];
    shift[static_cast<Index>(k)] = at[frozen_places_[k]] - from;
  }
  return shift;
}

// Squares of apart_ + frozen tangents * shift, without going over the samples again.
double CampaignCost::squaresAt(const VectorXd& at) const {
  if (frozen_places_.empty()) return apart_squares_;
  const VectorXd shift = shiftAt(at);
  return apart_squares_ + shift.dot(2.0 * frozen_along_ + frozen_->information * shift);
}

void CampaignCost::normalEquations(const VectorXd& at, Linear* linear) const {
  const auto all = static_cast<Index>(coordinates_.size());
  linear->squares = squaresAt(at);
  linear->information.setZero(all, all);
  linear->gradient.resize(all);
  linear->gradient(own_places_) = own_along_;
  linear->information(own_places_, own_places_) = own_gram_;
  if (frozen_places_.empty()) return;
  const VectorXd shift = shiftAt(at);
  linear->information(frozen_places_, frozen_places_) = frozen_->information;
  linear->information(frozen_places_, own_places_) = frozen_own_;
  linear->information(own_places_, frozen_places_) = frozen_own_.transpose();
  linear->gradient(frozen_places_) = frozen_along_ + frozen_->information * shift;
  linear->gradient(own_places_) += frozen_own_.transpose() * shift;
}

VectorXd CampaignCost::residual(const VectorXd& at) const {
  VectorXd residual = apart_;
  if (!frozen_places_.empty()) frozen_->columns.addTo(shiftAt(at), &residual);
  return residual;
}

VectorXd CampaignCost::influence(const VectorXd& amplitudes) const {
  VectorXd sum = VectorXd::Zero(apart_.size());
  own_columns_.addTo(amplitudes(own_places_), &sum);
  if (!frozen_places_.empty()) frozen_->columns.addTo(amplitudes(frozen_places_), &sum);
  return sum;
}

const CampaignCost::Linear* CampaignCost::linearise(const VectorXd& at) const {
  // Where a step was refused the twin stands elsewhere: residual() and influence() are of this point.
  if (!simulate(at)) return nullptr;
  if (same(linearised_at_, at)) return &linear_;
  linearised_at_.reset();
  if (!takeTangents(at)) return nullptr;
  normalEquations(at, &linear_);
  linearised_at_ = at;
  return &linear_;
}

std::optional<VectorXd> CampaignCost::pointAt(const VectorXd& own) const {
  VectorXd at = start_point_;
  at(own_places_) = own;
  if (!simulate(at)) return {};
  if (frozen_places_.empty()) return at;
  MatrixXd information = frozen_->information;
  const VectorXd precision = precision_(frozen_places_);
  const VectorXd taken_at = -shiftAt(VectorXd::Zero(at.size()));
  const VectorXd right =
      information * taken_at - frozen_along_ + precision.cwiseProduct(null_(frozen_places_));
  information.diagonal() += precision;
  at(frozen_places_) = fit::leastWithin(information, right, low_(frozen_places_), high_(frozen_places_));
  return at;
}

double CampaignCost::frozenPenalty(const VectorXd& at) const {
  double penalty = 0.0;
  for (const Index c : frozen_places_) penalty += precision_[c] * std::pow(at[c] - null_[c], 2);
  return penalty;
}

// What is simulated alone, with priors on the rest in the squares: frozen coordinates follow where no bound
// holds them.
CampaignCost::Linear CampaignCost::eliminated(const VectorXd& at, const Linear& of_all) const {
  Linear own{of_all.squares + frozenPenalty(at), of_all.information(own_places_, own_places_),
             of_all.gradient(own_places_)};
  std::vector<Index> follow;
  for (const Index c : frozen_places_) {
    if (at[c] > low_[c] && at[c] < high_[c]) follow.push_back(c);
  }
  if (follow.empty()) return own;
  MatrixXd information = of_all.information(follow, follow);
  information.diagonal() += precision_(follow);
  const MatrixXd beside = of_all.information(follow, own_places_);
  own.information -= beside.transpose() * linear::solveSymmetric(information, beside);
  return own;
}

std::optional<VectorXd> CampaignCost::straightOn(const VectorXd& at) const {
  const Linear* const here = linearise(at);
  if (!here) return {};
  const VectorXd right = here->information * at - here->gradient + precision_.cwiseProduct(null_);
  MatrixXd information = here->information;
  information.diagonal() += precision_;
  return fit::leastWithin(information, right, low_, high_);
}

double CampaignCost::penaltyAt(const VectorXd& at) const {
  const auto n = static_cast<Index>(turnsBegin());
  return precision_.head(n).dot((at - null_).head(n).cwiseAbs2());
}

double CampaignCost::promisedAt(const VectorXd& own) const {
  const std::optional<VectorXd> at = pointAt(own);
  const Linear* of_all = at ? linearise(*at) : nullptr;
  if (!of_all) return 0.0;
  Linear point = eliminated(*at, *of_all);
  const VectorXd precision = precision_(own_places_);
  point.gradient += precision.cwiseProduct(own - null_(own_places_));
  point.information.diagonal() += precision;
  std::vector<Index> moves;
  for (Index k = 0; k < own.size(); ++k) {
    const Index c = own_places_[static_cast<std::size_t>(k)];
    const bool pressed =
        (own[k] <= low_[c] && point.gradient[k] > 0.0) || (own[k] >= high_[c] && point.gradient[k] < 0.0);
    if (!pressed) moves.push_back(k);
  }
  const VectorXd gradient = point.gradient(moves);
  const MatrixXd information = point.information(moves, moves);
  return gradient.dot(linear::solveSymmetric(information, gradient));
}

bool CampaignCost::evaluate(const VectorXd& own, VectorXd* residual, MatrixXd* jacobian) const {
  const Index n = own.size();
  VectorXd& r = *residual;
  r.setZero();
  const VectorXd prior_root = precision_(own_places_).cwiseSqrt();
  r.tail(n) = prior_root.cwiseProduct(own - null_(own_places_));
  const std::optional<VectorXd> at = pointAt(own);
  if (!at) return false;
  if (!jacobian) {
    r[n] = std::sqrt(std::max(squaresAt(*at) + frozenPenalty(*at), 0.0));
    return true;
  }
  const Linear* of_all = linearise(*at);
  if (!of_all) return false;
  const Linear point = eliminated(*at, *of_all);
  // information = R' R; the residual's share along the tangents is R'^-1 gradient.
  const linear::SymmetricRoot root = linear::symmetricRoot(point.information, point.gradient);
  MatrixXd& j = *jacobian;
  j.topRows(n) = root.root;
  r.head(n) = root.along;
  r[n] = std::sqrt(std::max(point.squares - r.head(n).squaredNorm(), 0.0));
  j.bottomRows(n) = prior_root.asDiagonal();
  return true;
}

}  // namespace smartmill::discrepancy
