#include "smartmill_discrepancy/search/refinement.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "smartmill_discrepancy/search/evidence.h"
#include "smartmill_discrepancy/search/start_values.h"

namespace smartmill::discrepancy {
namespace {

// Derivatives and prior weight at the refined state.
struct RefinedState {
  NominalTangents tangents;
  double weight = 1.0;
  bool converged = false;
};

// Largest change of a value, in its standard deviations.
double largestChange(const FitState& from, const FitState& to, const Eigen::MatrixXd& covariance) {
  double largest = 0.0;
  Eigen::Index k = 0;
  const auto compare = [&](const std::vector<double>& a, const std::vector<double>& b) {
    for (std::size_t c = 0; c < a.size(); ++c, ++k)
      largest = std::max(largest, std::abs(a[c] - b[c]) / std::sqrt(covariance(k, k)));
  };
  compare(from.nominal, to.nominal);
  for (std::size_t m = 0; m < from.members.size(); ++m) compare(from.members[m].values, to.members[m].values);
  if (from.alignment.size() == to.alignment.size()) compare(from.alignment, to.alignment);
  return largest;
}

FitOptions weighted(FitOptions options, double weight) {
  options.prior_weight = weight;
  return options;
}

// Converges to the exact solution by correcting the quick twin at each iterate. Convergence is measured in
// standard deviations, since the cost hardly changes along a narrow valley.
RefinedState iterate(Workbench& bench, FitState from, FitResult* best, const SearchOptions& options) {
  RefinedState refined;
  bool reuse_tangents = false;
  for (int pass = 0; pass <= options.refinement_passes; ++pass) {
    const bool realigned = bench.alignment().alignPhases(from) > 0.0;
    double squares = 0.0;
    refined.tangents = reuse_tangents ? bench.lineariseBy(std::move(refined.tangents), from, &squares)
                                      : bench.linearise(from, &squares);
    // With an unexplained residual the stated uncertainties count in proportion to its variance.
    refined.weight = std::max(1.0, squares / bench.samples());
    // The covariance along a valley requires all derivatives at one point.
    FitResult here =
        bench.quick().fit(from, &refined.tangents, weighted(FitOptions::toEvaluate(), refined.weight));
    if (!here.converged) break;
    const Eigen::MatrixXd covariance = refined.weight * here.covariance;
    *best = std::move(here);
    refined.converged = true;
    if (pass == options.refinement_passes || bench.cancelled()) break;
    const FitResult next = bench.quick().fit(from, &refined.tangents, weighted({6, 1e-5}, refined.weight));
    if (!next.converged) break;
    FitState next_state = next.state;
    // If values can replace each other, frozen derivatives slow the others down: the linear optimum may be
    // better.
    const std::optional<FitState> linear =
        bench.quick().linearOptimum(from, refined.tangents, refined.weight);
    if (linear && largestChange(next.state, *linear, covariance) > options.min_distance) {
      const auto cost = [&](const FitState& state) {
        return bench.exactSquares(state) + bench.quick().penalty(state, refined.weight);
      };
      if (cost(*linear) < cost(next.state)) next_state = *linear;
    }
    const double by = largestChange(from, next_state, covariance);
    if (by < options.tolerance && !realigned) break;
    reuse_tangents = by < options.same_tangents && !realigned;
    from = next_state;
  }
  return refined;
}

// Alternatives of a member among the candidates of the rounds that accepted it, the latest fit of each.
std::vector<const Candidate*> alternativesOf(const FitState& state, std::size_t member,
                                             const std::vector<Candidate>& candidates,
                                             const SearchOptions& options) {
  const Hypothesis& own = *state.members[member].hypothesis;
  std::map<std::size_t, double> largest;  // gain of the rounds
  for (const Candidate& r : candidates) {
    if (r.result.accepted && r.result.effect == own.effect && r.result.variant == own.variant)
      largest[r.result.round] = 0.0;
  }
  for (const Candidate& r : candidates) {
    const auto round = largest.find(r.result.round);
    if (round != largest.end()) round->second = std::max(round->second, r.result.delta_bic);
  }
  std::vector<const Candidate*> alternatives;
  for (const Candidate& r : candidates) {
    const auto round = largest.find(r.result.round);
    if (round == largest.end() || r.result.effect == own.effect ||
        r.result.delta_bic < options.near * round->second ||
        hasMember(state, r.result.effect, r.result.variant))
      continue;
    const auto isEarlier = [&](const Candidate* a) { return a->hypothesis == r.hypothesis; };
    alternatives.erase(std::remove_if(alternatives.begin(), alternatives.end(), isEarlier),
                       alternatives.end());
    alternatives.push_back(&r);
  }
  return alternatives;
}

// Start of an alternative's fit.
std::vector<double> startOf(const Fitter& fitter, const Candidate& alternative, const Member& member) {
  return equivalentValues(fitter, member, *alternative.hypothesis).value_or(alternative.values);
}

// Whether an alternative has enough of the member's effect; otherwise both may act independently.
bool replaces(const FitResult& alternative, const FitResult& member, const FitResult& without_member,
              double min_overlap) {
  double product = 0.0, own = 0.0;
  for (std::size_t i = 0; i < without_member.residual.size(); ++i) {
    const double d = without_member.residual[i] - member.residual[i];
    product += d * (without_member.residual[i] - alternative.residual[i]);
    own += d * d;
  }
  return product > min_overlap * own;
}

}  // namespace

Candidate fitCandidate(const Fitter& fitter, const PredictedGain& predicted, std::size_t round,
                       const FitResult& now, const std::function<FitResult()>& fit, FitResult* tried) {
  const auto begin = std::chrono::steady_clock::now();
  const std::size_t simulations = fitter.runner().simulations();
  *tried = fit();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const Hypothesis& hypothesis = *predicted.hypothesis;
  return {{round, hypothesis.effect, hypothesis.variant, predicted.gain, now.bic - tried->bic, false, seconds,
           fitter.runner().simulations() - simulations},
          &hypothesis,
          tried->state.members.back().values};
}

FitResult withoutUnneeded(const Fitter& fitter, FitResult fit, const NominalTangents& tangents,
                          const SearchOptions& options, bool keep_newest) {
  const std::vector<Member>& members = fit.state.members;
  const std::size_t kept = keep_newest ? 1 : 0;
  for (std::size_t m = 0; m + kept < members.size() && members.size() > 1;) {
    FitResult less = fitter.fit(without(fit.state, m), &tangents, FitOptions::toCompare());
    if (isSignificant(fitter.runner(), less, fit, options)) {
      ++m;
      continue;
    }
    options.log("  no longer needed: " + members[m].hypothesis->title());
    fit = std::move(less);
  }
  return fit;
}

void refitSimplerAlternatives(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents,
                              const SearchOptions& options, std::vector<Candidate>* candidates) {
  for (std::size_t m = 0; m < now.state.members.size(); ++m) {
    for (const Candidate* alternative : alternativesOf(now.state, m, *candidates, options)) {
      Candidate& simpler = (*candidates)[static_cast<std::size_t>(alternative - candidates->data())];
      if (simpler.values.size() >= now.state.members[m].values.size()) continue;
      FitState with = without(now.state, m);
      with.members.push_back({simpler.hypothesis, startOf(fitter, simpler, now.state.members[m])});
      const FitResult fit = fitter.fit(with, &tangents, FitOptions::tightly());
      if (fit.converged) simpler.values = fit.state.members.back().values;
    }
  }
}

bool refine(Workbench& bench, const FitState& state, const SearchOptions& options, SearchResult* result) {
  const RefinedState refined = iterate(bench, state, &result->best, options);
  if (!refined.converged) return false;
  bench.alignment().alignTo(result->best.state);
  const FitOptions compared = weighted(FitOptions::toCompare(), refined.weight);
  const FitState& at = result->best.state;
  result->clearComparisons();
  for (std::size_t m = 0; m < at.members.size(); ++m) {
    const FitState less = without(at, m);
    FitOptions without_it = compared;
    without_it.to_beat = result->best.chi2 + result->best.penalty;
    const FitResult rest = bench.quick().fit(less, &refined.tangents, without_it);
    result->contribution.push_back(rest.bic - result->best.bic);
    result->without_member.push_back(rest.state);
    result->is_needed.push_back(isSignificant(bench.quick().runner(), rest, result->best, options));
    for (const Candidate* alternative : alternativesOf(at, m, result->candidates, options)) {
      FitState with = less;
      with.members.push_back({alternative->hypothesis, startOf(bench.quick(), *alternative, at.members[m])});
      const FitResult fit = bench.quick().fit(with, &refined.tangents, without_it);
      if (fit.converged && rest.converged && replaces(fit, result->best, rest, options.min_overlap))
        result->alternatives.push_back({m, alternative->result.effect, rest.bic - fit.bic, fit.state});
    }
  }
  return true;
}

Eigen::MatrixXd robustCovariance(Workbench& bench, const FitResult& best) {
  const NominalTangents tangents = bench.linearise(best.state);
  const double weight = std::max(1.0, best.chi2 / bench.samples());
  const Eigen::MatrixXd covariance = bench.quick().sandwichCovariance(best.state, tangents, weight);
  return covariance.size() > 0 ? covariance : weight * best.covariance;
}

void dropInsignificantPathShare(const MachineModel& nominal, const NominalFreedom& freedom,
                                const Eigen::MatrixXd& of_fit, FitResult* best) {
  const std::optional<std::size_t> path_share = freedom.pathShare();
  if (!path_share || of_fit.cols() != best->covariance.cols()) return;
  const EffectEntry* const stated = toothPathOf(nominal);
  const double before = stated ? stated->numbers.at("share") : 0.0;
  FitState& state = best->state;
  const auto k = static_cast<Eigen::Index>(*path_share);
  const double share = before + state.nominal[*path_share];
  if (share == 0.0 || freedom.isPathShareSignificant(share, std::sqrt(best->covariance(k, k)))) return;
  const Eigen::VectorXd by = -share / of_fit(k, k) * of_fit.col(k);
  const double* next = by.data();
  const auto move = [&](const std::vector<Coordinate>& coordinates, std::vector<double>* values) {
    for (std::size_t c = 0; c < values->size(); ++c)
      (*values)[c] = std::clamp((*values)[c] + *next++, coordinates[c].low, coordinates[c].high);
  };
  move(freedom.coordinates(), &state.nominal);
  for (Member& m : state.members) move(m.hypothesis->coordinates, &m.values);
  for (double& value : state.alignment) value += *next++;
  state.nominal[*path_share] = -before;
}

}  // namespace smartmill::discrepancy
