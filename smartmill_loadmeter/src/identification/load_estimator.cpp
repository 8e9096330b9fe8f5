#include "load_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "term_search.h"

namespace smartmill::loadmeter {

LoadEstimator::LoadEstimator(std::vector<LoadRecord> records, const Spindle& spindle,
                             double spindle_uncertainty, const LoadRecordOptions& options, double noise,
                             bool timed, const std::string& where)
    : options_(options),
      spindle_uncertainty_(spindle_uncertainty / 100.0),
      where_(where.empty() ? "" : where + ": "),
      plan_(records, spindle.friction_zero_below, timed, !(noise > 0.0), options.least_feeds, where_),
      regression_(plan_, spindle, spindle_uncertainty_, options),
      state_(regression_.initialState(std::move(records), noise)) {
}

LoadRecordResult LoadEstimator::estimate() {
  state_ = regression_.converge(std::move(state_), regression_.initialTerms());
  std::optional<RunoutAveraging> averaging;
  if (plan_.has_teeth && !plan_.has_angle && options_.runout_uncertainty > 0.0) {
    averaging.emplace(regression_, state_, options_.runout_uncertainty * std::sqrt(3.0));
    averaging->addAliasedVariance(averaging->average(state_), &state_);
    averageOverRunout(*averaging);
  }
  bool added = false;
  const TermSearch search(regression_, plan_);
  while (options_.choose_terms && regression_.recordsDisagree(state_.solution)) {
    std::optional<LoadState> further = search.add(state_);
    if (!further) break;
    state_ = std::move(*further);
    added = true;
  }
  if (averaging && added) averageOverRunout(*averaging);
  return result();
}

void LoadEstimator::averageOverRunout(const RunoutAveraging& averaging) {
  average_ = averaging.average(state_);
  averaging.applyOffset(average_->offset, &state_);
  const LoadTerms terms = state_.solution.terms;
  state_ = regression_.converge(std::move(state_), terms);
}

LoadRecordResult LoadEstimator::result() const {
  LoadRecordResult result;
  const Eigen::Index tc = static_cast<Eigen::Index>(state_.solution.terms.ktcIndex()), te = tc + 1;
  Eigen::MatrixXd total = regression_.covariance(state_);
  CoefficientSet& set = result.set;
  set.value = set.std_dev = NOT_IDENTIFIED;
  set.value.ktc = state_.solution.ktc();
  set.value.kte = state_.solution.kte();
  if (average_) {
    set.value.ktc = average_->ktc;
    set.value.kte = average_->kte;
    total(tc, tc) += average_->variance_tc;
    total(te, te) += average_->variance_te;
    total(tc, te) += average_->covariance;
  }
  // Errors of load_meter_v_per_w and of the depth scale both coefficients.
  const double scale =
      std::hypot(options_.spindle_uncertainty ? spindle_uncertainty_ : 0.0, options_.depth_uncertainty);
  const auto stdOf = [&](Eigen::Index i, double value) {
    return std::sqrt(total(i, i) + scale * scale * value * value);
  };
  set.std_dev.ktc = stdOf(tc, set.value.ktc);
  set.std_dev.kte = stdOf(te, set.value.kte);
  result.covariance_tc_te = total(tc, te) + scale * scale * set.value.ktc * set.value.kte;
  set.source = "load_meter";
  set.tests = static_cast<int>(plan_.cuts);
  addDetails(&result);
  return result;
}

void LoadEstimator::addDetails(LoadRecordResult* result) const {
  const LoadSolution& solution = state_.solution;
  const LoadTerms& terms = solution.terms;
  result->friction = regression_.frictionOf(solution);
  if (plan_.air_cuts > 0) {
    result->set.friction_viscous = result->friction.viscous;
    result->set.friction_coulomb = result->friction.coulomb;
  }
  result->bandwidth = regression_.spindle().load_meter_bandwidth / std::exp(state_.log_lag);
  if (terms.growth) result->edge_growth = state_.growth;
  if (terms.runout) {
    const Runout& runout = state_.point.runout;
    result->runout = std::hypot(runout.x, runout.y);
    result->runout_angle = std::atan2(runout.y, runout.x);
    if (result->runout_angle < 0.0) result->runout_angle += units::TWO_PI;
  } else if (average_ && average_->is_significant) {
    result->runout = average_->offset;
    result->runout_angle = std::numeric_limits<double>::quiet_NaN();
  }
  result->noise = state_.noise;
  result->misfit = solution.misfit;
  result->disagreement = solution.disagreement;
  const LoadTerms initial = regression_.initialTerms();
  for (const FurtherTerm& term : furtherTerms()) {
    if (terms.*term.flag && !(initial.*term.flag)) result->terms.push_back(term.name);
  }
  if (regression_.recordsDisagree(solution)) {
    result->notes.push_back(
        where_ +
        formatted("the records disagree by %.3f %% (chi2 %.1f per degree of freedom): the model lacks "
                  "an effect, which biases the coefficients",
                  100.0 * solution.disagreement, solution.misfit));
  }
}

}  // namespace smartmill::loadmeter
