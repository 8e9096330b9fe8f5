#include "fit/campaign_coordinates.h"

#include <algorithm>
#include <cmath>

namespace smartmill::discrepancy {

using Eigen::Index;
using Eigen::VectorXd;

CampaignCoordinates::CampaignCoordinates(const Fitter& fitter, const FitState& start,
                                         const NominalTangents* frozen, const FitOptions& options,
                                         const AlignmentReachOptions& reach)
    : fitter_(fitter), start_state_(start), frozen_tangents_(frozen) {
  all_ = fitter.freedom().coordinates();
  nominal_count_ = all_.size();
  for (const Member& m : start.members)
    all_.insert(all_.end(), m.hypothesis->coordinates.begin(), m.hypothesis->coordinates.end());
  const bool nominal_frozen = frozen && !frozen->at.empty();
  if (frozen) addAlignments(reach);
  const std::size_t own_begin = nominal_frozen ? nominal_count_ : 0, own_end = all_.size() - alignment_count_;
  for (std::size_t c = 0; c < all_.size(); ++c)
    (c < own_begin || c >= own_end ? frozen_ : own_).push_back(static_cast<Index>(c));
  setPoints(options.prior_weight);
}

void CampaignCoordinates::setPoints(double prior_weight) {
  const FitState& s = start_state_;
  std::vector<double> start(s.nominal.begin(),
                            s.nominal.begin() + static_cast<std::ptrdiff_t>(nominal_count_));
  for (const Member& m : s.members) start.insert(start.end(), m.values.begin(), m.values.end());
  if (alignment_count_ > 0) start.insert(start.end(), s.alignment.begin(), s.alignment.end());
  const auto count = static_cast<Index>(all_.size());
  for (VectorXd* of : {&start_, &low_, &high_, &precision_, &null_}) of->resize(count);
  for (Index c = 0; c < count; ++c) {
    const auto k = static_cast<std::size_t>(c);
    low_[c] = all_[k].low;
    high_[c] = all_[k].high;
    precision_[c] = prior_weight / (all_[k].prior_std * all_[k].prior_std);
    null_[c] = all_[k].null;
    start_[c] = std::clamp(start[k], low_[c], high_[c]);
  }
}

// Alignment is bounded to the range where its derivatives are valid.
void CampaignCoordinates::addAlignments(const AlignmentReachOptions& options) {
  alignment_count_ = frozen_tangents_->alignment.size();
  start_state_.alignment.resize(alignment_count_, 0.0);
  for (std::size_t k = 0; k < alignment_count_; ++k) {
    const AlignmentFreedom& free = fitter_.alignment()[k].freedom;
    const bool entry = free.value == &RecordAlignment::entry;
    const double at = frozen_tangents_->alignment[k], reach = entry ? options.entry : options.rotation;
    start_state_.alignment[k] = std::clamp(start_state_.alignment[k], at - reach, at + reach);
    all_.push_back({"alignment", entry ? 0.0 : at, at - reach, at + reach, 0.0, free.prior_std});
  }
}

FitState CampaignCoordinates::stateAt(const VectorXd& at) const {
  FitState state = start_state_;
  std::copy(at.data(), at.data() + nominal_count_, state.nominal.begin());
  const double* next = at.data() + nominal_count_;
  for (Member& m : state.members) {
    std::copy(next, next + m.values.size(), m.values.begin());
    next += m.values.size();
  }
  std::copy(next, next + alignment_count_, state.alignment.begin());
  return state;
}

MachineModel CampaignCoordinates::modelAt(const VectorXd& at) const {
  FitState state = stateAt(at);
  if (frozen_tangents_ && !frozen_tangents_->at.empty()) state.nominal = frozen_tangents_->at;
  return fitter_.model(state);
}

VectorXd CampaignCoordinates::shiftAt(const VectorXd& at) const {
  VectorXd shift(static_cast<Index>(frozen_.size()));
  const std::size_t alignment_begin = frozen_.size() - alignment_count_;
  for (std::size_t k = 0; k < frozen_.size(); ++k) {
    const double from =
        k < alignment_begin ? frozen_tangents_->at[k] : frozen_tangents_->alignment[k - alignment_begin];
    shift[static_cast<Index>(k)] = at[frozen_[k]] - from;
  }
  return shift;
}

double CampaignCoordinates::frozenPenaltyAt(const VectorXd& at) const {
  double penalty = 0.0;
  for (const Index c : frozen_) penalty += precision_[c] * std::pow(at[c] - null_[c], 2);
  return penalty;
}

double CampaignCoordinates::penaltyAt(const VectorXd& at) const {
  const auto n = static_cast<Index>(all_.size() - alignment_count_);
  return precision_.head(n).dot((at - null_).head(n).cwiseAbs2());
}

}  // namespace smartmill::discrepancy
