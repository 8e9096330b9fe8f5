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

// @return false where the twin refuses
bool CampaignCost::simulate(const VectorXd& at) const {
  if (same(simulated_at_, at)) return true;
  try {
    simulated_ = fitter_.runner().simulate(modelAt(at));
  } catch (const Error&) {
    return false;  // a point that the twin refuses is no better point
  }
  simulated_at_ = at;
  return true;
}

// Columns along what is not frozen. simulate() stands at the point.
bool CampaignCost::tangentsAt(const VectorXd& at, MatrixXd* own) const {
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
  std::vector<Values> simulated;
  try {
    simulated = fitter_.runner().simulate(models);
  } catch (const Error&) {
    return false;
  }
  own->resize(static_cast<Index>(simulated_.size()), static_cast<Index>(step.size()));
  for (std::size_t k = 0; k < step.size(); ++k)
    own->col(static_cast<Index>(k)) = (asVector(simulated[k]) - asVector(simulated_)) / step[k];
  return own->allFinite();
}

void CampaignCost::normalEquations(const MatrixXd& own, Linear* linear) const {
  const auto all = static_cast<Index>(coordinates_.size());
  const Index moving = own.cols(), fixed = all - moving;
  linear->information.setZero(all, all);
  linear->gradient.resize(all);
  linear->gradient.tail(moving).noalias() = own.transpose() * linear->residual;
  linear->information.bottomRightCorner(moving, moving).noalias() = own.transpose() * own;
  if (fixed == 0) return;
  if (frozen_information_.size() == 0)
    frozen_information_.noalias() = frozen_->columns.transpose() * frozen_->columns;
  linear->information.topLeftCorner(fixed, fixed) = frozen_information_;
  linear->information.topRightCorner(fixed, moving).noalias() = frozen_->columns.transpose() * own;
  linear->information.bottomLeftCorner(moving, fixed) =
      linear->information.topRightCorner(fixed, moving).transpose();
  linear->gradient.head(fixed).noalias() = frozen_->columns.transpose() * linear->residual;
}

bool CampaignCost::residualAt(const VectorXd& at, VectorXd* residual) const {
  if (!simulate(at)) return false;
  *residual = asVector(simulated_) - asVector(fitter_.runner().measured());
  if (frozen_ && nominal_ > 0) {
    VectorXd shift = at.head(static_cast<Index>(nominal_)) - asVector(frozen_->at);
    residual->noalias() += frozen_->columns * shift;
  }
  return residual->allFinite();
}

const CampaignCost::Linear* CampaignCost::linearise(const VectorXd& at) const {
  if (same(linearised_at_, at)) return &linear_;
  linearised_at_.resize(0);
  MatrixXd own;
  if (!residualAt(at, &linear_.residual) || !tangentsAt(at, &own)) return nullptr;
  normalEquations(own, &linear_);
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
    VectorXd all;
    if (!residualAt(at, &all)) return false;
    r[n] = all.norm();
    return true;
  }
  const Linear* at_point = linearise(at);
  if (!at_point) return false;
  // information = R' R; the residual's share along the tangents is R'^-1 gradient.
  const linear::SymmetricRoot root = linear::symmetricRoot(at_point->information, at_point->gradient);
  MatrixXd& j = *jacobian;
  j.topRows(n) = root.root;
  r.head(n) = root.along;
  r[n] = std::sqrt(std::max(at_point->residual.squaredNorm() - r.head(n).squaredNorm(), 0.0));
  for (Index c = 0; c < n; ++c)
    j(n + 1 + c, c) = prior_root / coordinates_[static_cast<std::size_t>(c)].prior_std;
  return true;
}

}  // namespace smartmill::discrepancy
