#include "fit/campaign_linearisation.h"

#include <cmath>
#include <utility>
#include <vector>

#include "fit/tangent.h"
#include "smartmill_core/error.h"

namespace smartmill::discrepancy {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

bool same(const std::optional<VectorXd>& a, const VectorXd& b) {
  return a && *a == b;
}

}  // namespace

// Unchanged spans keep their products.
void CampaignLinearisation::compare(SimulatedChannels simulated) {
  const TwinRunner& runner = fitter_.runner();
  const std::vector<ChannelSpan>& spans = runner.spans();
  const auto count = static_cast<Index>(spans.size());
  const Index frozen = hasFrozen() ? coordinates_.frozenTangents().columns.cols() : 0;
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
    if (frozen > 0) span_along_.col(b) = coordinates_.frozenTangents().columns.along(span, difference_);
  });
  simulated_ = std::move(simulated);
  difference_squares_ = span_squares_.sum();
  if (frozen > 0) frozen_along_ = span_along_.rowwise().sum();
}

bool CampaignLinearisation::simulate(const VectorXd& at) {
  const VectorXd own = at(coordinates_.own());
  if (same(simulated_at_, own)) return std::isfinite(difference_squares_);
  try {
    compare(std::move(fitter_.runner().simulateChannels({coordinates_.modelAt(at)}).front()));
  } catch (const Error&) {
    return false;  // rejected by the twin
  }
  simulated_at_ = own;
  return std::isfinite(difference_squares_);
}

// Derivatives with respect to the own coordinates, and their products, at the point of simulate().
bool CampaignLinearisation::updateTangents(const VectorXd& at) {
  const VectorXd here = at(coordinates_.own());
  if (same(tangents_at_, here)) return true;
  tangents_at_.reset();
  std::vector<MachineModel> models;
  std::vector<double> step;
  for (const Index c : coordinates_.own()) {
    const Coordinate& k = coordinates_.all()[static_cast<std::size_t>(c)];
    step.push_back(TANGENT * (at[c] + k.step > k.high ? -k.step : k.step));
    VectorXd moved = at;
    moved[c] += step.back();
    models.push_back(coordinates_.modelAt(moved));
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
  if (hasFrozen()) frozen_own_ = coordinates_.frozenTangents().columns.cross(own_columns_);
  tangents_at_ = here;
  return true;
}

// Squares of difference_ + frozen derivatives * shift.
double CampaignLinearisation::squaresAt(const VectorXd& at) const {
  if (!hasFrozen()) return difference_squares_;
  const VectorXd shift = coordinates_.shiftAt(at);
  return difference_squares_ +
         shift.dot(2.0 * frozen_along_ + coordinates_.frozenTangents().information * shift);
}

void CampaignLinearisation::setNormalEquations(const VectorXd& at) {
  const auto all = static_cast<Index>(coordinates_.size());
  const std::vector<Index>&own = coordinates_.own(), &frozen = coordinates_.frozen();
  linear_.squares = squaresAt(at);
  linear_.information.setZero(all, all);
  linear_.gradient.resize(all);
  linear_.gradient(own) = own_along_;
  linear_.information(own, own) = own_gram_;
  if (frozen.empty()) return;
  const VectorXd shift = coordinates_.shiftAt(at);
  const NominalTangents& tangents = coordinates_.frozenTangents();
  linear_.information(frozen, frozen) = tangents.information;
  linear_.information(frozen, own) = frozen_own_;
  linear_.information(own, frozen) = frozen_own_.transpose();
  linear_.gradient(frozen) = frozen_along_ + tangents.information * shift;
  linear_.gradient(own) += frozen_own_.transpose() * shift;
}

VectorXd CampaignLinearisation::residual(const VectorXd& at) const {
  VectorXd residual = difference_;
  if (hasFrozen()) coordinates_.frozenTangents().columns.addTo(coordinates_.shiftAt(at), &residual);
  return residual;
}

VectorXd CampaignLinearisation::influence(const VectorXd& amplitudes) const {
  VectorXd sum = VectorXd::Zero(difference_.size());
  own_columns_.addTo(amplitudes(coordinates_.own()), &sum);
  if (hasFrozen()) coordinates_.frozenTangents().columns.addTo(amplitudes(coordinates_.frozen()), &sum);
  return sum;
}

const CampaignLinearisation::Linear* CampaignLinearisation::linearise(const VectorXd& at) {
  // After a rejected step the twin is elsewhere; residual() and influence() refer to this point.
  if (!simulate(at)) return nullptr;
  if (same(linearised_at_, at)) return &linear_;
  linearised_at_.reset();
  if (!updateTangents(at)) return nullptr;
  setNormalEquations(at);
  linearised_at_ = at;
  return &linear_;
}

}  // namespace smartmill::discrepancy
