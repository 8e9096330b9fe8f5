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
    throw Error("fit: frozen derivatives of nominal values require free nominal values");
  if (frozen_) addAlignments();
  const std::size_t own_begin = nominal_frozen ? nominal_ : 0;
  for (std::size_t c = 0; c < coordinates_.size(); ++c)
    (c < own_begin || c >= alignmentBegin() ? frozen_indices_ : own_indices_)
        .push_back(static_cast<Index>(c));
  setPoints();
}

void CampaignCost::setPoints() {
  Values start(start_.nominal.begin(), start_.nominal.begin() + static_cast<std::ptrdiff_t>(nominal_));
  for (const Member& m : start_.members) start.insert(start.end(), m.values.begin(), m.values.end());
  if (alignment_count_ > 0) start.insert(start.end(), start_.alignment.begin(), start_.alignment.end());
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

// Alignment is bounded to the range where its derivatives are valid.
void CampaignCost::addAlignments() {
  constexpr double REACH = 0.05;  // [rad]
  alignment_count_ = frozen_->alignment.size();
  start_.alignment.resize(alignment_count_, 0.0);
  for (std::size_t k = 0; k < alignment_count_; ++k) {
    const AlignmentFreedom& free = fitter_.alignment()[k].freedom;
    const bool entry = free.value == &RecordAlignment::entry;
    const double at = frozen_->alignment[k], reach = entry ? 1.0 : REACH;
    start_.alignment[k] = std::clamp(start_.alignment[k], at - reach, at + reach);
    coordinates_.push_back({"alignment", entry ? 0.0 : at, at - reach, at + reach, 0.0, free.prior_std});
  }
}

std::vector<fit::Parameter> CampaignCost::parameters() const {
  std::vector<fit::Parameter> parameters;
  for (const Index c : own_indices_) parameters.push_back({start_point_[c], low_[c], high_[c], 1.0});
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
  std::copy(next, next + alignment_count_, state.alignment.begin());
  return state;
}

MachineModel CampaignCost::modelAt(const VectorXd& at) const {
  FitState state = stateAt(at);
  if (frozen_ && !frozen_->at.empty()) state.nominal = frozen_->at;
  return fitter_.model(state);
}

VectorXd CampaignCost::ownOf(const VectorXd& at) const {
  return at(own_indices_);
}

// Unchanged spans keep their products.
void CampaignCost::compare(SimulatedChannels simulated) const {
  const TwinRunner& runner = fitter_.runner();
  const std::vector<ChannelSpan>& spans = runner.spans();
  const auto count = static_cast<Index>(spans.size());
  const Index frozen = frozen_indices_.empty() ? 0 : frozen_->columns.cols();
  const bool first = simulated_.empty();
  if (first) {
    difference_.resize(static_cast<Index>(runner.size()));
    span_squares_.resize(count);
    span_along_.resize(frozen, count);
  }
  runParallel(spans.size(), runner.threads(), [&](std::size_t span) {
    if (!first && simulated[span] == simulated_[span]) return;
    const auto b = static_cast<Index>(span);
    auto segment =
        difference_.segment(static_cast<Index>(spans[span].offset), static_cast<Index>(spans[span].size));
    runner.compare(simulated, span, segment.data());
    span_squares_[b] = segment.squaredNorm();
    if (frozen > 0) span_along_.col(b) = frozen_->columns.along(span, difference_);
  });
  simulated_ = std::move(simulated);
  difference_squares_ = span_squares_.sum();
  if (frozen > 0) frozen_along_ = span_along_.rowwise().sum();
}

// @return false if the twin rejects the point or gives no finite values
bool CampaignCost::simulate(const VectorXd& at) const {
  const VectorXd own = ownOf(at);
  if (same(simulated_at_, own)) return std::isfinite(difference_squares_);
  try {
    compare(std::move(fitter_.runner().simulateChannels({modelAt(at)}).front()));
  } catch (const Error&) {
    return false;  // rejected by the twin
  }
  simulated_at_ = own;
  return std::isfinite(difference_squares_);
}

// Derivatives with respect to simulated coordinates, and their products, at the point of simulate().
bool CampaignCost::updateTangents(const VectorXd& at) const {
  const VectorXd here = ownOf(at);
  if (same(tangents_at_, here)) return true;
  tangents_at_.reset();
  std::vector<MachineModel> models;
  Values step;
  for (const Index c : own_indices_) {
    const Coordinate& k = coordinates_[static_cast<std::size_t>(c)];
    step.push_back(TANGENT * (at[c] + k.step > k.high ? -k.step : k.step));
    VectorXd moved = at;
    moved[c] += step.back();
    models.push_back(modelAt(moved));
  }
  try {
    own_columns_ =
        SparseColumns(fitter_.runner(), simulated_, fitter_.runner().simulateChannels(models), step);
  } catch (const Error&) {
    return false;
  }
  if (!own_columns_.allFinite()) return false;
  own_gram_ = own_columns_.gram();
  own_along_ = own_columns_.along(difference_);
  if (!frozen_indices_.empty()) frozen_own_ = frozen_->columns.cross(own_columns_);
  tangents_at_ = here;
  return true;
}

// Of the frozen coordinates from the point of their derivatives.
VectorXd CampaignCost::shiftAt(const VectorXd& at) const {
  VectorXd shift(static_cast<Index>(frozen_indices_.size()));
  const std::size_t alignment_begin = frozen_indices_.size() - alignment_count_;
  for (std::size_t k = 0; k < frozen_indices_.size(); ++k) {
    const double from = k < alignment_begin ? frozen_->at[k] : frozen_->alignment[k - alignment_begin];
    shift[static_cast<Index>(k)] = at[frozen_indices_[k]] - from;
  }
  return shift;
}

// Squares of difference_ + frozen derivatives * shift, without iterating over the samples.
double CampaignCost::squaresAt(const VectorXd& at) const {
  if (frozen_indices_.empty()) return difference_squares_;
  const VectorXd shift = shiftAt(at);
  return difference_squares_ + shift.dot(2.0 * frozen_along_ + frozen_->information * shift);
}

void CampaignCost::normalEquations(const VectorXd& at, Linear* linear) const {
  const auto all = static_cast<Index>(coordinates_.size());
  linear->squares = squaresAt(at);
  linear->information.setZero(all, all);
  linear->gradient.resize(all);
  linear->gradient(own_indices_) = own_along_;
  linear->information(own_indices_, own_indices_) = own_gram_;
  if (frozen_indices_.empty()) return;
  const VectorXd shift = shiftAt(at);
  linear->information(frozen_indices_, frozen_indices_) = frozen_->information;
  linear->information(frozen_indices_, own_indices_) = frozen_own_;
  linear->information(own_indices_, frozen_indices_) = frozen_own_.transpose();
  linear->gradient(frozen_indices_) = frozen_along_ + frozen_->information * shift;
  linear->gradient(own_indices_) += frozen_own_.transpose() * shift;
}

VectorXd CampaignCost::residual(const VectorXd& at) const {
  VectorXd residual = difference_;
  if (!frozen_indices_.empty()) frozen_->columns.addTo(shiftAt(at), &residual);
  return residual;
}

VectorXd CampaignCost::influence(const VectorXd& amplitudes) const {
  VectorXd sum = VectorXd::Zero(difference_.size());
  own_columns_.addTo(amplitudes(own_indices_), &sum);
  if (!frozen_indices_.empty()) frozen_->columns.addTo(amplitudes(frozen_indices_), &sum);
  return sum;
}

const CampaignCost::Linear* CampaignCost::linearise(const VectorXd& at) const {
  // After a rejected step the twin is elsewhere; residual() and influence() refer to this point.
  if (!simulate(at)) return nullptr;
  if (same(linearised_at_, at)) return &linear_;
  linearised_at_.reset();
  if (!updateTangents(at)) return nullptr;
  normalEquations(at, &linear_);
  linearised_at_ = at;
  return &linear_;
}

std::optional<VectorXd> CampaignCost::pointAt(const VectorXd& own) const {
  VectorXd at = start_point_;
  at(own_indices_) = own;
  if (!simulate(at)) return {};
  if (frozen_indices_.empty()) return at;
  MatrixXd information = frozen_->information;
  const VectorXd precision = precision_(frozen_indices_);
  const VectorXd linearised_at = -shiftAt(VectorXd::Zero(at.size()));
  const VectorXd right =
      information * linearised_at - frozen_along_ + precision.cwiseProduct(null_(frozen_indices_));
  information.diagonal() += precision;
  at(frozen_indices_) =
      fit::minimiseWithin(information, right, low_(frozen_indices_), high_(frozen_indices_));
  return at;
}

double CampaignCost::frozenPenalty(const VectorXd& at) const {
  double penalty = 0.0;
  for (const Index c : frozen_indices_) penalty += precision_[c] * std::pow(at[c] - null_[c], 2);
  return penalty;
}

// Normal equations of the simulated coordinates; frozen ones that are not at a bound follow their optimum,
// their priors are part of the squares.
CampaignCost::Linear CampaignCost::withFrozenEliminated(const VectorXd& at, const Linear& of_all) const {
  Linear own{of_all.squares + frozenPenalty(at), of_all.information(own_indices_, own_indices_),
             of_all.gradient(own_indices_)};
  std::vector<Index> free_frozen;
  for (const Index c : frozen_indices_) {
    if (at[c] > low_[c] && at[c] < high_[c]) free_frozen.push_back(c);
  }
  if (free_frozen.empty()) return own;
  MatrixXd information = of_all.information(free_frozen, free_frozen);
  information.diagonal() += precision_(free_frozen);
  const MatrixXd coupling = of_all.information(free_frozen, own_indices_);
  own.information -= coupling.transpose() * linear::solveSymmetric(information, coupling);
  return own;
}

std::optional<VectorXd> CampaignCost::linearOptimumFrom(const VectorXd& at) const {
  const Linear* const here = linearise(at);
  if (!here) return {};
  const VectorXd right = here->information * at - here->gradient + precision_.cwiseProduct(null_);
  MatrixXd information = here->information;
  information.diagonal() += precision_;
  return fit::minimiseWithin(information, right, low_, high_);
}

double CampaignCost::penaltyAt(const VectorXd& at) const {
  const auto n = static_cast<Index>(alignmentBegin());
  return precision_.head(n).dot((at - null_).head(n).cwiseAbs2());
}

double CampaignCost::predictedReductionAt(const VectorXd& own) const {
  const std::optional<VectorXd> at = pointAt(own);
  const Linear* of_all = at ? linearise(*at) : nullptr;
  if (!of_all) return 0.0;
  Linear point = withFrozenEliminated(*at, *of_all);
  const VectorXd precision = precision_(own_indices_);
  point.gradient += precision.cwiseProduct(own - null_(own_indices_));
  point.information.diagonal() += precision;
  std::vector<Index> free_to_move;
  for (Index k = 0; k < own.size(); ++k) {
    const Index c = own_indices_[static_cast<std::size_t>(k)];
    const bool pushes_outwards =
        (own[k] <= low_[c] && point.gradient[k] > 0.0) || (own[k] >= high_[c] && point.gradient[k] < 0.0);
    if (!pushes_outwards) free_to_move.push_back(k);
  }
  const VectorXd gradient = point.gradient(free_to_move);
  const MatrixXd information = point.information(free_to_move, free_to_move);
  return gradient.dot(linear::solveSymmetric(information, gradient));
}

bool CampaignCost::evaluate(const VectorXd& own, VectorXd* residual, MatrixXd* jacobian) const {
  const Index n = own.size();
  VectorXd& r = *residual;
  r.setZero();
  const VectorXd prior_root = precision_(own_indices_).cwiseSqrt();
  r.tail(n) = prior_root.cwiseProduct(own - null_(own_indices_));
  const std::optional<VectorXd> at = pointAt(own);
  if (!at) return false;
  if (!jacobian) {
    r[n] = std::sqrt(std::max(squaresAt(*at) + frozenPenalty(*at), 0.0));
    return true;
  }
  const Linear* of_all = linearise(*at);
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
