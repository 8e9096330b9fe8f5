#include "search/projection.h"

#include <cmath>
#include <numeric>
#include <utility>

#include "smartmill_core/math/linear_algebra.h"

namespace smartmill::discrepancy {
namespace {

using Eigen::Index;

// Ridge that keeps systems with equal or empty columns solvable: share of a column's squares, and absolute.
constexpr double RIDGE_SHARE = 1e-9, RIDGE = 1e-30, MEMBER_RIDGE = 1e-12;

Eigen::MatrixXd stacked(const Eigen::MatrixXd& upper, const Eigen::MatrixXd& lower) {
  Eigen::MatrixXd all(upper.rows() + lower.rows(), upper.cols());
  all << upper, lower;
  return all;
}

SparseColumns tangentsOfMembers(const Fitter& fitter, const FitState& state, SimulatedChannels* base) {
  std::vector<std::size_t> all(state.members.size());
  std::iota(all.begin(), all.end(), 0u);
  return memberTangents(fitter, state, all, base);
}

double costReduction(const Eigen::MatrixXd& information, const Eigen::VectorXd& score,
                     const Eigen::VectorXd& by) {
  return 2.0 * score.dot(by) - by.dot(information * by);
}

}  // namespace

Projection::Projection(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents)
    : freedom_(fitter.freedom().coordinates()),
      nominal_(now.state.nominal),
      tangents_(tangents),
      members_(tangentsOfMembers(fitter, now.state, &base_)),
      prior_(priorsOf(fitter)),
      residual_(
          Eigen::Map<const Eigen::VectorXd>(now.residual.data(), static_cast<Index>(fitter.runner().size()))),
      pull_(pullOf(fitter, now.state)),
      bounds_(freedom_, nominal_, prior_),
      thinned_(fitter.runner()) {
  information_.resize(prior_.size(), prior_.size());
  information_.leftCols(tangents.columns.cols()) =
      stacked(tangents.information, members_.cross(tangents.columns));
  information_.rightCols(members_.cols()) = stacked(tangents.columns.cross(members_), members_.gram());
  information_.diagonal() += prior_;
  score_ = stacked(tangents.columns.along(residual_), members_.along(residual_)) + pull_;
  baseline_ = bounds_.solve(information_, score_);
  Eigen::VectorXd residual = residual_;
  move(-baseline_.by, &residual);
  baseline_residual_ = std::make_shared<const Eigen::VectorXd>(std::move(residual));
  thinSamples();
}

Eigen::VectorXd Projection::priorsOf(const Fitter& fitter) const {
  Eigen::VectorXd prior(tangents_.columns.cols() + members_.cols());
  for (std::size_t k = 0; k < tangents_.alignment.size(); ++k)
    prior[static_cast<Index>(freedom_.size() + k)] = std::pow(fitter.alignment()[k].freedom.prior_std, -2.0);
  for (std::size_t c = 0; c < freedom_.size(); ++c)
    prior[static_cast<Index>(c)] = 1.0 / (freedom_[c].prior_std * freedom_[c].prior_std);
  prior.tail(members_.cols()) = MEMBER_RIDGE + RIDGE_SHARE * members_.squares().array();
  return prior;
}

// Of the priors towards the stated values.
Eigen::VectorXd Projection::pullOf(const Fitter& fitter, const FitState& state) const {
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(prior_.size());
  for (std::size_t c = 0; c < freedom_.size(); ++c)
    pull[static_cast<Index>(c)] = -nominal_[c] * prior_[static_cast<Index>(c)];
  for (std::size_t k = 0; k < tangents_.alignment.size(); ++k) {
    const auto at = static_cast<Index>(freedom_.size() + k);
    if (fitter.alignment()[k].freedom.value == &RecordAlignment::entry && !state.alignment.empty())
      pull[at] = -state.alignment[k] * prior_[at];
  }
  return pull;
}

// vector += change by nominal values, alignment and members.
void Projection::move(const Eigen::VectorXd& by, Eigen::VectorXd* vector) const {
  tangents_.columns.addTo(by.head(tangents_.columns.cols()), vector);
  members_.addTo(by.tail(members_.cols()), vector);
}

Projection::Reduction Projection::reduction(const SparseColumns& columns) const {
  return reduction(information_, score_, baseline_.by,
                   stacked(tangents_.columns.cross(columns), members_.cross(columns)), columns.gram(),
                   columns.along(residual_));
}

Projection::Reduction Projection::reduction(const Eigen::MatrixXd& information, const Eigen::VectorXd& score,
                                            const Eigen::VectorXd& baseline, const Eigen::MatrixXd& cross,
                                            Eigen::MatrixXd own, const Eigen::VectorXd& along) const {
  const Index fixed_count = information.rows(), count = own.rows();
  own.diagonal() = own.diagonal().array() * (1.0 + RIDGE_SHARE) + RIDGE;
  Eigen::MatrixXd all(fixed_count + count, fixed_count + count);
  all << information, cross, cross.transpose(), own;
  Eigen::VectorXd right(fixed_count + count);
  right << score, along;
  const ConstrainedStep step = bounds_.solve(all, right);
  Reduction result;
  result.gain = costReduction(all, right, step.by) - costReduction(information, score, baseline);
  result.amplitudes = step.by.tail(count);
  result.all_else = step.by.head(fixed_count);
  return result;
}

std::shared_ptr<const Eigen::VectorXd> Projection::changeBy(const SparseColumns& columns,
                                                            const Reduction& reduction) const {
  auto simulated = std::make_shared<Eigen::VectorXd>(Eigen::VectorXd::Zero(residual_.size()));
  columns.addTo(reduction.amplitudes, simulated.get());
  move(reduction.all_else - baseline_.by, simulated.get());
  return simulated;
}

ScaleEvidence Projection::priorEvidence(const Reduction& reduction) const {
  ScaleEvidence evidence;
  for (std::size_t c = 0; c < freedom_.size(); ++c) {
    const double by = reduction.all_else[static_cast<Index>(c)];
    const double d = (by - baseline_.by[static_cast<Index>(c)]) / freedom_[c].prior_std;
    evidence.squares += d * d;
    evidence.product -= d * (nominal_[c] + by - freedom_[c].null) / freedom_[c].prior_std;
  }
  return evidence;
}

double Projection::roughGain(const Eigen::MatrixXd& columns) const {
  return reduction(thinned_information_, thinned_score_, thinned_baseline_,
                   thinned_columns_.transpose() * columns, columns.transpose() * columns,
                   columns.transpose() * thinned_residual_)
      .gain;
}

Eigen::VectorXd Projection::roughGains(const Eigen::MatrixXd& columns, bool positive) const {
  Eigen::MatrixXd cross = thinned_columns_.transpose() * columns;
  for (const Index c : baseline_.at_bounds) cross.row(c).setZero();
  const Eigen::MatrixXd solved = linear::solveSymmetric(thinned_fixed_information_, cross);
  const Eigen::VectorXd raw = columns.colwise().squaredNorm();
  const Eigen::VectorXd own = raw - (cross.cwiseProduct(solved)).colwise().sum().transpose();
  const Eigen::VectorXd score = columns.transpose() * thinned_baseline_residual_;
  Eigen::VectorXd result = Eigen::VectorXd::Zero(columns.cols());
  for (Index k = 0; k < columns.cols(); ++k) {
    if (!std::isfinite(own[k]) || !std::isfinite(score[k]) || raw[k] == 0.0) continue;
    if (!positive || score[k] > 0.0)
      result[k] = score[k] * score[k] / (own[k] + RIDGE_SHARE * raw[k] + RIDGE);
  }
  return result;
}

// Thinned residual and derivatives.
void Projection::thinSamples() {
  const Eigen::MatrixXd nominal = thinned_.of(tangents_.columns), members = thinned_.of(members_);
  thinned_columns_.resize(nominal.rows(), nominal.cols() + members.cols());
  thinned_columns_ << nominal, members;
  thinned_residual_ = thinned_.of(residual_);
  thinned_baseline_residual_ = thinned_.of(*baseline_residual_);
  thinned_information_.setZero(thinned_columns_.cols(), thinned_columns_.cols());
  if (thinned_columns_.size() > 0)
    thinned_information_.selfadjointView<Eigen::Lower>().rankUpdate(thinned_columns_.transpose());
  thinned_information_ = thinned_information_.selfadjointView<Eigen::Lower>();
  thinned_information_.diagonal() += prior_;
  thinned_fixed_information_ = bounds_.fixedAt(baseline_.at_bounds, thinned_information_);
  thinned_score_ = thinned_columns_.transpose() * thinned_residual_ + pull_;
  thinned_baseline_ = bounds_.solve(thinned_information_, thinned_score_).by;
}

}  // namespace smartmill::discrepancy
