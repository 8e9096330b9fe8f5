#include "smartmill_discrepancy/search.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace smartmill::discrepancy {
namespace {

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

FitState without(const FitState& state, std::size_t member) {
  FitState less = state;
  less.members.erase(less.members.begin() + static_cast<std::ptrdiff_t>(member));
  return less;
}

}  // namespace

SearchResult search(const Fitter& quick, const Fitter& exact, const std::vector<Hypothesis>& hypotheses,
                    const SearchOptions& options) {
  const auto say = [&](const std::string& line) {
    if (options.progress) options.progress(line);
  };
  SearchResult result;
  FitState state;
  state.nominal.assign(quick.freedom().coordinates().size(), 0.0);
  NominalTangents tangents = quick.nominalTangents(state);
  Fit now = quick.fit(state, &tangents, {});
  result.null = now;
  const double samples = static_cast<double>(quick.runner().size());
  say(text("nominal model, values free within their uncertainty: gap %.4f", std::sqrt(now.chi2 / samples), 0.0));
  for (std::size_t round = 0; round < options.most_effects; ++round) {
    if (round > 0) tangents = quick.nominalTangents(now.state);
    const std::vector<Promise> promises = screen(quick, now, tangents, hypotheses);
    Fit best = now;
    std::size_t fitted = 0;
    std::vector<Rung> rungs;
    for (const Promise& p : promises) {
      if (p.gain < options.least_gain) break;
      if (fitted >= options.fitted_per_round) break;
      FitState with = now.state;
      with.members.push_back({p.hypothesis, p.start});
      const Fit tried = quick.fit(with, &tangents, {6, 1e-3, true});
      ++fitted;
      rungs.push_back({round, p.hypothesis->effect, p.hypothesis->variant, p.gain, now.bic - tried.bic, false});
      say(text("  promise %.4g, gain %.4g  ", p.gain, now.bic - tried.bic) + describe(tried.state.members.back()));
      if (tried.bic < best.bic) best = tried;
    }
    const bool better = now.bic - best.bic > options.least_gain;
    for (Rung& r : rungs) {
      r.taken = better && r.effect == best.state.members.back().hypothesis->effect &&
                r.variant == best.state.members.back().hypothesis->variant;
      result.ladder.push_back(r);
    }
    if (!better) break;
    tangents = quick.nominalTangents(best.state);
    Fit refined = quick.fit(best.state, &tangents, {8, 1e-4, true});
    now = refined.bic < best.bic ? refined : best;
    // What was found earlier may have stood for what has been found now.
    for (std::size_t m = 0; m < now.state.members.size() && now.state.members.size() > 1;) {
      const Fit less = quick.fit(without(now.state, m), &tangents, {6, 1e-3, true});
      if (less.bic - now.bic < options.least_gain) {
        say("  not needed any more: " + now.state.members[m].hypothesis->title());
        now = less;
      } else {
        ++m;
      }
    }
    say(text("gap %.4f with ", std::sqrt(now.chi2 / samples), 0.0) + describe(now.state.members.back()));
  }
  if (now.state.members.empty()) {
    result.best = exact.fit(now.state, nullptr, {3, 1e-5, true});
    result.null = result.best;
    return result;
  }
  result.best = exact.fit(now.state, nullptr, {5, 1e-6, true});
  for (const Member& m : result.best.state.members) say("found " + describe(m));
  say(text("gap %.4f", std::sqrt(result.best.chi2 / samples), 0.0));
  for (std::size_t m = 0; m < now.state.members.size(); ++m) {
    const Fit less = quick.fit(without(now.state, m), &tangents, {6, 1e-3, true});
    result.contribution.push_back(less.bic - now.bic);
  }
  return result;
}

}  // namespace smartmill::discrepancy
