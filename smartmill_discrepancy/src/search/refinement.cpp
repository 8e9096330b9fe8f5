#include "smartmill_discrepancy/search/refinement.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>

#include "smartmill_discrepancy/search/evidence.h"

namespace smartmill::discrepancy {
namespace {

constexpr FitOptions COMPARED{6, 1e-3, true};

// Tangents and weight of the priors at the refined state.
struct Settled {
  NominalTangents tangents;
  double weight = 1.0;
  bool converged = false;
};

// Largest change of a value, in its standard deviations.
double moved(const FitState& from, const FitState& to, const Eigen::MatrixXd& covariance) {
  double largest = 0.0;
  Eigen::Index k = 0;
  const auto compare = [&](const std::vector<double>& a, const std::vector<double>& b) {
    for (std::size_t c = 0; c < a.size(); ++c, ++k)
      largest = std::max(largest, std::abs(a[c] - b[c]) / std::sqrt(covariance(k, k)));
  };
  compare(from.nominal, to.nominal);
  for (std::size_t m = 0; m < from.members.size(); ++m) compare(from.members[m].values, to.members[m].values);
  if (from.turns.size() == to.turns.size()) compare(from.turns, to.turns);
  return largest;
}

FitOptions weighted(FitOptions options, double weight) {
  options.prior_weight = weight;
  return options;
}

// The quick twin, made equal to the exact one at the state, finds the exact solution in a few passes. They
// end when no value moves by much of its standard deviation: in a narrow valley the cost says little.
Settled settle(Workbench& bench, FitState from, Fit* best) {
  constexpr int PASSES = 6;
  constexpr double SETTLED = 0.1, SAME_TANGENTS = 2.0, APART = 0.5;  // standard deviations
  Settled settled;
  bool tangents_hold = false;
  for (int pass = 0; pass <= PASSES; ++pass) {
    const bool turned = bench.turnPhases(from) > 0.0;
    double squares = 0.0;
    settled.tangents = tangents_hold ? bench.lineariseBy(std::move(settled.tangents), from, &squares)
                                     : bench.linearise(from, &squares);
    // Where structure is left the noise does not tell how well values are known; what is stated of them does.
    settled.weight = std::max(1.0, squares / bench.samples());
    // All tangents at one point: only these tell what is known along a valley.
    Fit here = bench.quick().fit(from, &settled.tangents, weighted({0, 1e-8, true}, settled.weight));
    if (!here.converged) break;
    const Eigen::MatrixXd covariance = settled.weight * here.covariance;
    *best = std::move(here);
    settled.converged = true;
    if (pass == PASSES || bench.cancelled()) break;
    const Fit next = bench.quick().fit(from, &settled.tangents, weighted({6, 1e-5, true}, settled.weight));
    if (!next.converged) break;
    FitState on = next.state;
    // Where values stand for each other, what only acts linearly holds the others back.
    const std::optional<FitState> straight = bench.quick().straightOn(from, settled.tangents, settled.weight);
    if (straight && moved(next.state, *straight, covariance) > APART) {
      const auto cost = [&](const FitState& state) {
        return bench.exactSquares(state) + bench.quick().penalty(state, settled.weight);
      };
      if (cost(*straight) < cost(next.state)) on = *straight;
    }
    const double by = moved(from, on, covariance);
    if (by < SETTLED && !turned) break;
    tangents_hold = by < SAME_TANGENTS && !turned;
    from = on;
  }
  return settled;
}

bool isMember(const FitState& state, const TriedEffect& tried) {
  return std::any_of(state.members.begin(), state.members.end(), [&](const Member& m) {
    return m.hypothesis->effect == tried.effect && m.hypothesis->variant == tried.variant;
  });
}

// What came near to a member in the round that took it.
std::vector<const Rung*> rivalsOf(const FitState& state, std::size_t member,
                                  const std::vector<Rung>& ladder) {
  constexpr double NEAR = 0.3;  // of the round's largest gain
  const Hypothesis& own = *state.members[member].hypothesis;
  std::size_t round = 0;
  for (const Rung& r : ladder) {
    if (r.tried.taken && r.tried.effect == own.effect && r.tried.variant == own.variant)
      round = r.tried.round;
  }
  double largest = 0.0;
  for (const Rung& r : ladder) {
    if (r.tried.round == round) largest = std::max(largest, r.tried.delta_bic);
  }
  std::vector<const Rung*> rivals;
  for (const Rung& r : ladder) {
    if (r.tried.round == round && r.tried.effect != own.effect && r.tried.delta_bic >= NEAR * largest &&
        !isMember(state, r.tried))
      rivals.push_back(&r);
  }
  return rivals;
}

// Where a rival's fit in the place of a member begins.
std::vector<double> startOf(const Fitter& fitter, const Rung& rival, const Member& member) {
  return inPlaceOf(fitter, member, *rival.hypothesis).value_or(rival.values);
}

// A rival does at least half of what the member does: what acts elsewhere may be there beside it.
bool standsFor(const Fit& rival, const Fit& member, const Fit& lacking) {
  double both = 0.0, own = 0.0;
  for (std::size_t i = 0; i < lacking.residual.size(); ++i) {
    const double d = lacking.residual[i] - member.residual[i];
    both += d * (lacking.residual[i] - rival.residual[i]);
    own += d * d;
  }
  return both > 0.5 * own;
}

}  // namespace

Rung rungOf(const Fitter& fitter, const Promise& promise, std::size_t round, const Fit& now,
            const std::function<Fit()>& fit, Fit* tried) {
  const auto begin = std::chrono::steady_clock::now();
  const std::size_t simulations = fitter.runner().simulations();
  *tried = fit();
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const Hypothesis& hypothesis = *promise.hypothesis;
  return {{round, hypothesis.effect, hypothesis.variant, promise.gain, now.bic - tried->bic, false, seconds,
           fitter.runner().simulations() - simulations},
          &hypothesis,
          tried->state.members.back().values};
}

void followSimpler(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                   std::vector<Rung>* ladder) {
  for (std::size_t m = 0; m < now.state.members.size(); ++m) {
    for (const Rung* rival : rivalsOf(now.state, m, *ladder)) {
      Rung& simpler = (*ladder)[static_cast<std::size_t>(rival - ladder->data())];
      if (simpler.values.size() >= now.state.members[m].values.size()) continue;
      FitState with = without(now.state, m);
      with.members.push_back({simpler.hypothesis, startOf(fitter, simpler, now.state.members[m])});
      const Fit fit = fitter.fit(with, &tangents, {8, 1e-5, true});
      if (fit.converged) simpler.values = fit.state.members.back().values;
    }
  }
}

bool refine(Workbench& bench, const FitState& state, const SearchOptions& options, SearchResult* result) {
  const Settled settled = settle(bench, state, &result->best);
  if (!settled.converged) return false;
  bench.turnTo(result->best.state);
  const FitOptions compared = weighted(COMPARED, settled.weight);
  const FitState& at = result->best.state;
  result->contribution.clear();
  result->needed.clear();
  result->lacking.clear();
  result->rivals.clear();
  for (std::size_t m = 0; m < at.members.size(); ++m) {
    const FitState less = without(at, m);
    FitOptions without_it = compared;
    without_it.to_beat = result->best.chi2 + result->best.penalty;
    const Fit rest = bench.quick().fit(less, &settled.tangents, without_it);
    result->contribution.push_back(rest.bic - result->best.bic);
    result->lacking.push_back(rest.state);
    result->needed.push_back(tells(bench.quick().runner(), rest, result->best, options));
    for (const Rung* rival : rivalsOf(at, m, result->ladder)) {
      FitState with = less;
      with.members.push_back({rival->hypothesis, startOf(bench.quick(), *rival, at.members[m])});
      const Fit fit = bench.quick().fit(with, &settled.tangents, without_it);
      if (fit.converged && rest.converged && standsFor(fit, result->best, rest))
        result->rivals.push_back({m, rival->tried.effect, rest.bic - fit.bic, fit.state});
    }
  }
  return true;
}

Eigen::MatrixXd settledCovariance(Workbench& bench, const Fit& best) {
  const NominalTangents tangents = bench.linearise(best.state);
  const double weight = std::max(1.0, best.chi2 / bench.samples());
  const Eigen::MatrixXd covariance = bench.quick().sandwichCovariance(best.state, tangents, weight);
  return covariance.size() > 0 ? covariance : weight * best.covariance;
}

void leaveOutUntoldPath(const MachineModel& nominal, const NominalFreedom& freedom,
                        const Eigen::MatrixXd& of_fit, Fit* best) {
  const std::optional<std::size_t> place = freedom.pathShare();
  if (!place || of_fit.cols() != best->covariance.cols()) return;
  const EffectEntry* const stated = toothPathOf(nominal);
  const double before = stated ? stated->numbers.at("share") : 0.0;
  FitState& state = best->state;
  const auto k = static_cast<Eigen::Index>(*place);
  const double share = before + state.nominal[*place];
  if (share == 0.0 || NominalFreedom::tellsPath(share, std::sqrt(best->covariance(k, k)))) return;
  const Eigen::VectorXd by = -share / of_fit(k, k) * of_fit.col(k);
  const double* next = by.data();
  const auto move = [&](const std::vector<Coordinate>& coordinates, std::vector<double>* values) {
    for (std::size_t c = 0; c < values->size(); ++c)
      (*values)[c] = std::clamp((*values)[c] + *next++, coordinates[c].low, coordinates[c].high);
  };
  move(freedom.coordinates(), &state.nominal);
  for (Member& m : state.members) move(m.hypothesis->coordinates, &m.values);
  for (double& turn : state.turns) turn += *next++;
  state.nominal[*place] = -before;
}

}  // namespace smartmill::discrepancy
