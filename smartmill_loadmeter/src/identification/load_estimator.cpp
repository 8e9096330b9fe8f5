#include "load_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {

namespace {

constexpr double STRONG_EVIDENCE = 10.0;  // BIC gain that a further term requires
// Share of the residual's squares that a further term must remove: a wrong term always removes some.
constexpr double REQUIRED_REDUCTION = 0.5;

}  // namespace

LoadEstimator::LoadEstimator(std::vector<LoadRecord> records, const Spindle& spindle,
                             double spindle_uncertainty, const LoadRecordOptions& options, double noise,
                             bool timed, const std::string& where)
    : options_(options),
      spindle_uncertainty_(spindle_uncertainty / 100.0),
      known_noise_(noise > 0.0),
      timed_(timed),
      where_(where.empty() ? "" : where + ": "),
      plan_(records, spindle.friction_zero_below, where_),
      regression_(plan_, spindle, spindle_uncertainty_, options, known_noise_),
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
  while (options_.choose_terms && state_.solution.recordsDisagree() && addTerm()) added = true;
  if (averaging && added) averageOverRunout(*averaging);
  return result();
}

void LoadEstimator::averageOverRunout(const RunoutAveraging& averaging) {
  average_ = averaging.average(state_);
  averaging.applyOffset(average_->offset, &state_);
  const LoadTerms terms = state_.solution.terms;
  state_ = regression_.converge(std::move(state_), terms);
}

std::vector<LoadTerms> LoadEstimator::furtherTerms() const {
  std::vector<LoadTerms> candidates;
  const std::size_t residuals = regression_.residualCount(state_);
  const LoadTerms& now = state_.solution.terms;
  const auto addIf = [&](bool possible, auto change) {
    LoadTerms terms = now;
    change(terms);
    if (possible && terms.count() + 2 <= residuals) candidates.push_back(terms);
  };
  addIf(!now.friction.stribeck && plan_.air_speeds >= 4, [](LoadTerms& t) { t.friction.stribeck = true; });
  addIf(!now.friction.warmup && timed_, [](LoadTerms& t) { t.friction.warmup = true; });
  addIf(!now.growth && plan_.edge_ages >= 3, [](LoadTerms& t) { t.growth = true; });
  addIf(!now.lag && !known_noise_, [](LoadTerms& t) { t.lag = true; });  // means have no transient
  return candidates;
}

// A further friction term is fitted from several starting points.
LoadSolution LoadEstimator::solveFromSeveralStarts(const LoadTerms& terms) const {
  const FrictionTerms& now = state_.solution.terms.friction;
  const bool stribeck = terms.friction.stribeck && !now.stribeck;
  const bool warmup = terms.friction.warmup && !now.warmup;
  std::optional<LoadSolution> best;
  for (const double share : {0.1, 0.25}) {
    for (const double constant : {150.0, 600.0, 2400.0}) {
      FrictionLaw start = state_.friction;
      if (!now.stribeck) start.stribeck_speed = std::max(share * plan_.fastest, plan_.slowest);
      if (!now.warmup) start.warmup_time = constant;
      const LoadSolution s = regression_.solve(state_, terms, start);
      if (!best || s.bic < best->bic) best = s;
      if (!warmup) break;
    }
    if (!stribeck) break;
  }
  return *best;
}

// Adds the term with the largest evidence. @return whether there was one with strong evidence.
bool LoadEstimator::addTerm() {
  std::optional<LoadState> best;
  const auto propose = [&](LoadState candidate) {
    if (!best || candidate.solution.bic < best->solution.bic) best = std::move(candidate);
  };
  for (const LoadTerms& terms : furtherTerms()) {
    LoadState candidate = state_;
    candidate.solution = solveFromSeveralStarts(terms);
    propose(std::move(candidate));
  }
  if (!state_.solution.terms.runout && plan_.has_angle) {
    // Runout changes the responses, which are condensed again about its estimate.
    LoadTerms terms = state_.solution.terms;
    terms.runout = true;
    propose(regression_.converge(state_, terms));
  }
  if (!best || best->solution.bic > state_.solution.bic - STRONG_EVIDENCE) return false;
  const auto squares = [](const LoadState& s) { return s.solution.fit.squares * s.noise * s.noise; };
  if (squares(*best) > REQUIRED_REDUCTION * squares(state_)) return false;
  best->friction = regression_.frictionOf(best->solution);
  const LoadTerms terms = best->solution.terms;
  state_ = regression_.converge(std::move(*best), terms);
  return true;
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
  if (terms.friction.stribeck) result->terms.push_back("Stribeck friction");
  if (terms.friction.warmup) result->terms.push_back("friction warm-up");
  if (terms.growth) result->terms.push_back("edge growth");
  if (terms.runout && !(options_.runout_uncertainty > 0.0)) result->terms.push_back("runout");
  if (terms.lag && !options_.spindle_uncertainty) result->terms.push_back("load-meter lag");
  if (solution.recordsDisagree()) {
    result->notes.push_back(
        where_ +
        formatted("the records disagree by %.3f %% (chi2 %.1f per degree of freedom): the model lacks "
                  "an effect, which biases the coefficients",
                  100.0 * solution.disagreement, solution.misfit));
  }
}

}  // namespace smartmill::loadmeter
