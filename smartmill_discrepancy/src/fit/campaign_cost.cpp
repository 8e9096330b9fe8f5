#include "fit/campaign_cost.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fit/tangent.h"
#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::discrepancy {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Values = std::vector<double>;

Eigen::Map<const VectorXd> asVector(const Values& v) {
  return Eigen::Map<const VectorXd>(v.data(), static_cast<Index>(v.size()));
}

bool same(const VectorXd& a, const VectorXd& b) {
  return a.size() == b.size() && a == b;
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
}

std::vector<fit::Parameter> CampaignCost::parameters() const {
  Values start(start_.nominal.begin(), start_.nominal.begin() + static_cast<std::ptrdiff_t>(nominal_));
  for (const Member& m : start_.members) start.insert(start.end(), m.values.begin(), m.values.end());
  std::vector<fit::Parameter> parameters;
  for (std::size_t c = 0; c < start.size(); ++c)
    parameters.push_back({start[c], coordinates_[c].low, coordinates_[c].high, 1.0});
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
  return state;
}

MachineModel CampaignCost::modelAt(const VectorXd& at) const {
  FitState state = stateAt(at);
  if (frozen_) state.nominal = frozen_->at;
  return fitter_.model(state);
}

double CampaignCost::precision(std::size_t coordinate) const {
  const double std_dev = coordinates_[coordinate].prior_std;
  return prior_weight_ / (std_dev * std_dev);
}

// @return false where the twin refuses or gives no numbers
bool CampaignCost::simulate(const VectorXd& at) const {
  if (same(simulated_at_, at)) return true;
  const TwinRunner& runner = fitter_.runner();
  try {
    simulated_ = std::move(runner.simulateBlocks({modelAt(at)}).front());
  } catch (const Error&) {
    return false;  // a point that the twin refuses is no better point
  }
  apart_ = asVector(runner.joined(simulated_)) - asVector(runner.measured());
  apart_squares_ = apart_.squaredNorm();
  if (!std::isfinite(apart_squares_)) {
    simulated_at_.resize(0);
    return false;
  }
  if (frozen_) frozen_along_ = frozen_->columns.along(apart_);
  simulated_at_ = at;
  return true;
}

// Columns along what is not frozen. simulate() stands at the point.
bool CampaignCost::tangentsAt(const VectorXd& at, BlockColumns* own) const {
  const Index first = frozen_ ? static_cast<Index>(nominal_) : 0;
  std::vector<MachineModel> models;
  Values step;
  for (Index c = first; c < at.size(); ++c) {
    const Coordinate& k = coordinates_[static_cast<std::size_t>(c)];
    step.push_back(TANGENT * (at[c] + k.step > k.high ? -k.step : k.step));
    VectorXd moved = at;
    moved[c] += step.back();
    models.push_back(modelAt(moved));
  }
  try {
    *own = BlockColumns(fitter_.runner(), simulated_, fitter_.runner().simulateBlocks(models), step);
  } catch (const Error&) {
    return false;
  }
  return own->allFinite();
}

// Of the frozen nominal values from where their tangents were taken.
VectorXd CampaignCost::shiftAt(const VectorXd& at) const {
  return at.head(static_cast<Index>(nominal_)) - asVector(frozen_->at).head(static_cast<Index>(nominal_));
}

// Squares of apart_ + frozen tangents * shift, without going over the samples again.
double CampaignCost::squaresAt(const VectorXd& at) const {
  if (!frozen_ || nominal_ == 0) return apart_squares_;
  const VectorXd shift = shiftAt(at);
  return apart_squares_ + shift.dot(2.0 * frozen_along_ + frozen_->information * shift);
}

void CampaignCost::normalEquations(const VectorXd& at, const BlockColumns& own, Linear* linear) const {
  const auto all = static_cast<Index>(coordinates_.size());
  const Index moving = own.cols(), fixed = all - moving;
  linear->squares = squaresAt(at);
  linear->information.setZero(all, all);
  linear->gradient.resize(all);
  linear->gradient.tail(moving) = own.along(apart_);
  linear->information.bottomRightCorner(moving, moving) = own.gram();
  if (fixed == 0) return;
  const MatrixXd cross = frozen_->columns.cross(own);
  const VectorXd shift = shiftAt(at);
  linear->information.topLeftCorner(fixed, fixed) = frozen_->information;
  linear->information.topRightCorner(fixed, moving) = cross;
  linear->information.bottomLeftCorner(moving, fixed) = cross.transpose();
  linear->gradient.head(fixed) = frozen_along_ + frozen_->information * shift;
  linear->gradient.tail(moving) += cross.transpose() * shift;
}

VectorXd CampaignCost::residual(const VectorXd& at) const {
  VectorXd residual = apart_;
  if (frozen_ && nominal_ > 0) frozen_->columns.addTo(shiftAt(at), &residual);
  return residual;
}

const CampaignCost::Linear* CampaignCost::linearise(const VectorXd& at) const {
  if (same(linearised_at_, at)) return &linear_;
  linearised_at_.resize(0);
  BlockColumns own;
  if (!simulate(at) || !tangentsAt(at, &own)) return nullptr;
  normalEquations(at, own, &linear_);
  linearised_at_ = at;
  return &linear_;
}

bool CampaignCost::evaluate(const VectorXd& at, VectorXd* residual, MatrixXd* jacobian) const {
  const Index n = at.size();
  VectorXd& r = *residual;
  r.setZero();
  const double prior_root = std::sqrt(prior_weight_);
  for (Index c = 0; c < n; ++c) {
    const Coordinate& k = coordinates_[static_cast<std::size_t>(c)];
    r[n + 1 + c] = prior_root * (at[c] - k.null) / k.prior_std;
  }
  if (!jacobian) {
    if (!simulate(at)) return false;
    r[n] = std::sqrt(std::max(squaresAt(at), 0.0));
    return true;
  }
  const Linear* at_point = linearise(at);
  if (!at_point) return false;
  // information = R' R; the residual's share along the tangents is R'^-1 gradient.
  const linear::SymmetricRoot root = linear::symmetricRoot(at_point->information, at_point->gradient);
  MatrixXd& j = *jacobian;
  j.topRows(n) = root.root;
  r.head(n) = root.along;
  r[n] = std::sqrt(std::max(at_point->squares - r.head(n).squaredNorm(), 0.0));
  for (Index c = 0; c < n; ++c)
    j(n + 1 + c, c) = prior_root / coordinates_[static_cast<std::size_t>(c)].prior_std;
  return true;
}

}  // namespace smartmill::discrepancy
