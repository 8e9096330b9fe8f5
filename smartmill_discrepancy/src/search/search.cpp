#include "smartmill_discrepancy/search/search.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>

namespace smartmill::discrepancy {
namespace {

constexpr double PHASE_SETTLED = 1e-4;  // [rad] of a turn of the records

std::string text(const char* format, double a, double b) {
  char line[160];
  std::snprintf(line, sizeof line, format, a, b);
  return line;
}

std::string describe(const Member& m) {
  std::string line = m.hypothesis->title() + ":";
  const EffectEntry entry = m.hypothesis->entry(m.values);
  for (const auto& [key, value] : numbersOf(entry)) line += " " + key + text(" %.5g", value, 0.0);
  return line;
}

double squaresLeft(const TwinRunner& runner, const std::vector<double>& simulated) {
  double squares = 0.0;
  for (std::size_t i = 0; i < simulated.size(); ++i)
    squares += std::pow(runner.measured()[i] - simulated[i], 2);
  return squares;
}

// Squares by channel.
std::map<std::string, double> squaresOf(const TwinRunner& runner, const std::vector<double>& values) {
  std::map<std::string, double> squares;
  for (const Block& b : runner.blocks()) {
    double& sum = squares[b.channel];
    for (std::size_t i = b.offset; i < b.offset + b.size; ++i) sum += values[i] * values[i];
  }
  return squares;
}

// Gain of BIC below which one fit is not better than another: in the channels in which they differ two
// faithful simulations differ by so many squares.
double leastGain(const TwinRunner& runner, const Fit& less, const Fit& more, const SearchOptions& options) {
  constexpr double SHARE = 0.05;  // of the gain, for a channel to count
  const auto before = squaresOf(runner, less.residual), after = squaresOf(runner, more.residual),
             signal = squaresOf(runner, runner.measured());
  double floor = 0.0;
  for (const auto& [channel, squares] : signal) {
    if (before.at(channel) - after.at(channel) > SHARE * (less.chi2 - more.chi2))
      floor += squares * options.twin_accuracy * options.twin_accuracy;
  }
  return std::max(options.least_gain, floor);
}

// Nominal values pulled far off their stated uncertainty speak for an effect even where they could stand for
// it.
bool relieves(const Fit& less, const Fit& more, const SearchOptions& options) {
  return less.bic - more.bic > options.least_prior_gain &&
         less.penalty - more.penalty > 4.0 * options.least_prior_gain;
}

// Whether a fit is better than one with less in it.
bool tells(const TwinRunner& runner, const Fit& less, const Fit& more, const SearchOptions& options) {
  return less.bic - more.bic > leastGain(runner, less, more, options) || relieves(less, more, options);
}

FitState without(const FitState& state, std::size_t member) {
  FitState less = state;
  less.members.erase(less.members.begin() + static_cast<std::ptrdiff_t>(member));
  return less;
}

// A mode of the tool found beside another on the same axis may be what the other stood for, and modes found
// axis by axis are one effect: the state with the newest modes of each axis in one member.
std::optional<FitState> withOneFlexibility(const FitState& state, const std::vector<Hypothesis>& hypotheses) {
  std::map<char, std::vector<double>> modes;
  FitState merged{state.nominal, {}};
  std::size_t members = 0;
  for (const Member& m : state.members) {
    if (m.hypothesis->effect != "tool_flexibility") {
      merged.members.push_back(m);
      continue;
    }
    ++members;
    for (std::size_t a = 0; a < m.hypothesis->variant.size(); ++a) {
      const auto from = m.values.begin() + static_cast<std::ptrdiff_t>(3 * a);
      modes[m.hypothesis->variant[a]].assign(from, from + 3);
    }
  }
  if (members < 2) return {};
  Member one{nullptr, {}};
  for (const Hypothesis& h : hypotheses) {
    if (h.effect != "tool_flexibility" || h.variant.size() != modes.size()) continue;
    one = {&h, {}};
    for (const char axis : h.variant) {
      if (modes.count(axis) == 0) one.hypothesis = nullptr;
      one.values.insert(one.values.end(), modes[axis].begin(), modes[axis].end());
    }
    if (one.hypothesis) break;
  }
  if (!one.hypothesis) return {};
  merged.members.push_back(std::move(one));
  return merged;
}

// The promise is linear: of shorter ways from the null point to its start the one that fits best.
std::vector<double> startOf(const Fitter& fitter, const Fit& now, const Promise& promise) {
  if (promise.null.empty()) return promise.start;
  std::vector<std::vector<double>> starts;
  std::vector<MachineModel> models;
  for (const double share : {1.0, 0.5, 0.2, 0.05}) {
    std::vector<double> start = promise.null;
    for (std::size_t c = 0; c < start.size(); ++c) start[c] += share * (promise.start[c] - promise.null[c]);
    FitState with = now.state;
    with.members.push_back({promise.hypothesis, start});
    starts.push_back(std::move(start));
    models.push_back(fitter.model(with));
  }
  const auto simulated = fitter.runner().simulate(models);
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < simulated.size(); ++k) {
    const double squares = squaresLeft(fitter.runner(), simulated[k]);
    if (squares < least) {
      least = squares;
      best = k;
    }
  }
  return starts[best];
}

}  // namespace

void refine(TwinRunner& quick_runner, const Fitter& quick, const Fitter& exact, const FitState& state,
            const SearchOptions& options, SearchResult* result) {
  // The quick runner, made equal to the exact one at the state, finds the exact solution in a few passes.
  // They end when no value moves by much of its standard deviation: in a narrow valley the cost says little.
  constexpr int PASSES = 6;
  constexpr double SETTLED = 0.1;
  NominalTangents tangents;
  FitState from = state;
  double weight = 1.0;
  for (int pass = 0; pass <= PASSES; ++pass) {
    const MachineModel model = quick.model(from);
    const bool turned = options.turn_phases && options.turn_phases(model) > PHASE_SETTLED * std::sqrt(weight);
    const std::vector<double> simulated = exact.runner().simulate(model);
    quick_runner.correctTo(model, simulated);
    // Where structure is left the noise does not tell how well values are known; what is stated of them does.
    weight = std::max(1.0, squaresLeft(exact.runner(), simulated) / static_cast<double>(simulated.size()));
    tangents = quick.nominalTangents(from);
    // All tangents at one point: only these tell what is known along a valley.
    Fit here = quick.fit(from, &tangents, {0, 1e-8, true, weight});
    if (!here.converged) break;
    const Eigen::MatrixXd covariance = weight * here.covariance;
    result->best = std::move(here);
    if (pass == PASSES) break;
    const Fit next = quick.fit(from, &tangents, {6, 1e-5, true, weight});
    if (!next.converged) break;
    double moved = 0.0;
    Eigen::Index k = 0;
    const auto compare = [&](const std::vector<double>& a, const std::vector<double>& b) {
      for (std::size_t c = 0; c < a.size(); ++c, ++k)
        moved = std::max(moved, std::abs(a[c] - b[c]) / std::sqrt(covariance(k, k)));
    };
    compare(from.nominal, next.state.nominal);
    for (std::size_t m = 0; m < from.members.size(); ++m)
      compare(from.members[m].values, next.state.members[m].values);
    if (moved < SETTLED && !turned) break;
    from = next.state;
  }
  const FitState& at = result->best.state;
  result->contribution.clear();
  result->needed.clear();
  result->rivals.clear();
  if (at.members.empty()) return;
  const double bic = result->best.bic;
  for (std::size_t m = 0; m < at.members.size(); ++m) {
    const FitState less = without(at, m);
    const Fit rest = quick.fit(less, &tangents, {6, 1e-3, true, weight});
    const double lost = rest.bic;
    result->contribution.push_back(lost - bic);
    result->needed.push_back(tells(quick.runner(), rest, result->best, options));
    const std::string& own = at.members[m].hypothesis->effect;
    // Rivals: what came near to it in the round that took it.
    std::size_t round = 0;
    for (const Rung& r : result->ladder) {
      if (r.taken && r.effect == own && r.variant == at.members[m].hypothesis->variant) round = r.round;
    }
    double largest = 0.0;
    for (const Rung& r : result->ladder) {
      if (r.round == round) largest = std::max(largest, r.delta_bic);
    }
    for (const Rung& r : result->ladder) {
      if (r.round != round || r.effect == own || r.delta_bic < 0.3 * largest) continue;
      const bool member = std::any_of(at.members.begin(), at.members.end(), [&](const Member& o) {
        return o.hypothesis->effect == r.effect && o.hypothesis->variant == r.variant;
      });
      if (member || !r.hypothesis) continue;
      FitState with = less;
      with.members.push_back({r.hypothesis, r.values});
      const Fit fit = quick.fit(with, &tangents, {6, 1e-3, true, weight});
      if (fit.converged) result->rivals.push_back({m, r.effect, r.variant, lost - fit.bic, fit.state});
    }
  }
}

SearchResult search(TwinRunner& quick_runner, const Fitter& quick, const Fitter& exact,
                    const std::vector<Hypothesis>& hypotheses, const SearchOptions& options) {
  const auto say = [&](const std::string& line) {
    if (options.progress) options.progress(line);
  };
  SearchResult result;
  FitState state;
  const std::vector<Coordinate>& free = quick.freedom().coordinates();
  state.nominal.assign(free.size(), 0.0);
  // What is missing pulls the nominal values far away, but they belong near to what is stated: there the
  // tangents are taken.
  const auto anchored = [&](FitState at) {
    constexpr double NEAR = 2.5;  // standard deviations
    for (std::size_t c = 0; c < free.size(); ++c) {
      const double reach = NEAR * free[c].prior_std;
      at.nominal[c] = std::clamp(at.nominal[c], free[c].null - reach, free[c].null + reach);
    }
    return at;
  };
  const auto linearise = [&](const FitState& where) {
    const FitState at = anchored(where);
    const MachineModel model = quick.model(at);
    quick_runner.correctTo(model, exact.runner().simulate(model));
    return quick.nominalTangents(at);
  };
  const auto turnPhases = [&](Fit fit, NominalTangents& tangents) {
    constexpr int PASSES = 4;
    for (int pass = 0; pass < PASSES && options.turn_phases; ++pass) {
      if (options.turn_phases(quick.model(fit.state)) < PHASE_SETTLED) break;
      tangents = linearise(fit.state);
      const double before = fit.bic;
      fit = quick.fit(fit.state, &tangents, {8, 1e-4, true});
      const double excess = fit.chi2 - static_cast<double>(quick.runner().size());
      if (std::abs(before - fit.bic) < std::max(1.0, 0.01 * excess)) break;
    }
    return fit;
  };
  // Nominal values that are off far: tangents are taken anew where the fit went.
  NominalTangents tangents;
  Fit now;
  for (int pass = 0; pass < 3; ++pass) {
    tangents = linearise(state);
    Fit fit = quick.fit(state, &tangents, {8, 1e-5, true});
    const bool settled = pass > 0 && std::abs(now.bic - fit.bic) < std::max(1.0, 1e-3 * fit.bic);
    now = std::move(fit);
    state = now.state;
    if (settled) break;
  }
  tangents = linearise(state);
  now = turnPhases(quick.fit(state, &tangents, {3, 1e-5, true}), tangents);
  result.null = now;
  const double samples = static_cast<double>(quick.runner().size());
  say(text("nominal model, values free within their uncertainty: gap %.4f", std::sqrt(now.chi2 / samples),
           0.0));
  // The quick runner may lie far from where it was corrected: near its stability limit a tool vibrates in it
  // that is quiet in the exact one, or the reverse.
  const auto exactSquares = [&](const FitState& at) {
    return squaresLeft(exact.runner(), exact.runner().simulate(quick.model(at)));
  };
  double exact_now = exactSquares(now.state);
  std::vector<const Hypothesis*> refused;
  std::size_t repeated = 0;
  for (std::size_t round = 0; round < options.most_effects + repeated; ++round) {
    const std::vector<Promise> promises = screen(quick, now, tangents, hypotheses);
    // A trifle beside what is left is not what is missing.
    const double least = std::max(options.least_gain, options.least_share * (now.chi2 - samples));
    // With next to nothing left but nominal values far off, an effect may do what they do; only all values
    // moved together go along that valley.
    const bool strained = now.chi2 - samples < 0.01 * samples && now.penalty > 4.0 * options.least_prior_gain;
    Fit best = now;
    double best_promise = 0.0;
    std::size_t fitted = 0;
    std::vector<Rung> rungs;
    for (const Promise& p : promises) {
      if (std::find(refused.begin(), refused.end(), p.hypothesis) != refused.end()) continue;
      if (p.gain < least && !(strained && p.gain > 4.0 * options.least_prior_gain)) break;
      if (fitted >= 2 && p.gain < 0.02 * promises.front().gain) break;
      if (fitted >= options.fitted_per_round) break;
      // One that leaves next to nothing can be bettered only by one that promises about as much.
      if (best.chi2 - samples < 0.02 * (now.chi2 - samples) && p.gain < 0.5 * best_promise) break;
      FitState with = now.state;
      with.members.push_back({p.hypothesis, startOf(quick, now, p)});
      const auto begin = std::chrono::steady_clock::now();
      const std::size_t simulations = quick.runner().simulations();
      const Fit tried = quick.fit(with, strained ? nullptr : &tangents, {6, 1e-3, true});
      ++fitted;
      rungs.push_back({round, p.hypothesis->effect, p.hypothesis->variant, p.gain, now.bic - tried.bic, false,
                       std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(),
                       quick.runner().simulations() - simulations, p.hypothesis,
                       tried.state.members.back().values});
      say(text("  promise %.4g, gain %.4g  ", p.gain, now.bic - tried.bic) +
          describe(tried.state.members.back()));
      if (tried.bic < best.bic) {
        best = tried;
        best_promise = p.gain;
      }
      // Nothing that is left could make another hypothesis better.
      if (fitted >= 2 && best.chi2 - samples < 0.01 * (now.chi2 - samples)) break;
    }
    const bool better = now.bic - best.bic > std::max(least, leastGain(quick.runner(), now, best, options)) ||
                        (now.chi2 - samples < 0.01 * samples && relieves(now, best, options));
    for (Rung& r : rungs) {
      r.taken = better && r.effect == best.state.members.back().hypothesis->effect &&
                r.variant == best.state.members.back().hypothesis->variant;
      result.ladder.push_back(r);
    }
    if (!better) break;
    const Fit before = now;
    const Hypothesis* const newest = best.state.members.back().hypothesis;
    tangents = linearise(best.state);
    if (const auto one = withOneFlexibility(best.state, hypotheses)) {
      const Fit merged = quick.fit(*one, &tangents, {8, 1e-4, true});
      if (merged.bic < best.bic) {
        best = merged;
        tangents = linearise(best.state);
      }
    }
    Fit refined = quick.fit(best.state, &tangents, {8, 1e-4, true});
    // The tangents held where the fit began; where it went far they are taken anew.
    tangents = linearise(refined.state);
    now = turnPhases(quick.fit(refined.state, &tangents, {8, 1e-4, true}), tangents);
    // What was found earlier may have stood for what has been found now.
    for (std::size_t m = 0; m < now.state.members.size() && now.state.members.size() > 1;) {
      const Fit less = quick.fit(without(now.state, m), &tangents, {6, 1e-3, true});
      if (!tells(quick.runner(), less, now, options)) {
        say("  not needed any more: " + now.state.members[m].hypothesis->title());
        now = less;
      } else {
        ++m;
      }
    }
    const double exact_squares = exactSquares(now.state);
    if (!(exact_squares < exact_now)) {
      say(text("gap %.4f when simulated exactly, not taken: ", std::sqrt(exact_squares / samples), 0.0) +
          newest->title());
      ++repeated;
      if (quick_runner.substeps() < options.final_substeps) {
        quick_runner.setSubsteps(std::min(4 * quick_runner.substeps(), options.final_substeps));
        say("  again with smaller steps");
      } else {
        refused.push_back(newest);
      }
      for (Rung& r : result.ladder) r.taken = r.taken && r.round != round;
      now = before;
      if (options.turn_phases) options.turn_phases(quick.model(now.state));
      tangents = linearise(now.state);
      now = quick.fit(now.state, &tangents, {8, 1e-4, true});
      exact_now = exactSquares(now.state);
      continue;
    }
    exact_now = exact_squares;
    say(text("gap %.4f with ", std::sqrt(now.chi2 / samples), 0.0) + describe(now.state.members.back()));
  }
  refine(quick_runner, quick, exact, now.state, options, &result);
  // With everything settled an effect may turn out to be needed no more.
  while (!result.contribution.empty()) {
    const auto least = std::min_element(result.contribution.begin(), result.contribution.end());
    const auto m = static_cast<std::size_t>(least - result.contribution.begin());
    if (result.needed[m]) break;
    say("  not needed any more: " + result.best.state.members[m].hypothesis->title());
    refine(quick_runner, quick, exact, without(result.best.state, m), options, &result);
  }
  for (const Member& m : result.best.state.members) say("found " + describe(m));
  return result;
}

}  // namespace smartmill::discrepancy
