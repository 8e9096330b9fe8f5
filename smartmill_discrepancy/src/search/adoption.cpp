#include "search/adoption.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace smartmill::discrepancy {
namespace {

using PieceValues = std::map<std::string, std::vector<double>>;  // values by the name of a piece

// The form of an effect with exactly these pieces.
std::optional<Member> formOf(const std::string& effect, const PieceValues& pieces,
                             const std::vector<Hypothesis>& hypotheses) {
  for (const Hypothesis& h : hypotheses) {
    if (h.effect != effect || h.pieces.size() != pieces.size()) continue;
    if (!std::all_of(h.pieces.begin(), h.pieces.end(),
                     [&](const std::string& name) { return pieces.count(name) > 0; }))
      continue;
    Member one{&h, {}};
    for (const std::string& name : h.pieces) {
      const std::vector<double>& values = pieces.at(name);
      one.values.insert(one.values.end(), values.begin(), values.end());
    }
    return one;
  }
  return {};
}

// The state with all members of one effect merged.
std::optional<FitState> mergedState(const FitState& state, const std::string& effect,
                                    const std::vector<Hypothesis>& hypotheses) {
  PieceValues pieces;
  FitState merged_state{state.nominal, {}, state.alignment};
  std::size_t members = 0;
  for (const Member& m : state.members) {
    if (m.hypothesis->effect != effect) {
      merged_state.members.push_back(m);
      continue;
    }
    ++members;
    for (std::size_t k = 0; k < m.hypothesis->pieces.size(); ++k)
      pieces[m.hypothesis->pieces[k]] = m.hypothesis->pieceOf(m.values, k);
  }
  if (members < 2) return {};
  const std::optional<Member> one = formOf(effect, pieces, hypotheses);
  if (!one) return {};
  merged_state.members.push_back(*one);
  return merged_state;
}

// Merges separately found pieces of one effect (modes of the tool, axis by axis) into one member, with the
// newest values of each piece.
std::optional<FitState> withPiecesMerged(const FitState& state, const std::vector<Hypothesis>& hypotheses) {
  for (const Member& m : state.members) {
    if (m.hypothesis->pieces.empty()) continue;
    if (const auto one = mergedState(state, m.hypothesis->effect, hypotheses)) return one;
  }
  return {};
}

}  // namespace

void adopt(SearchState& s, FitResult best) {
  s.linearise(best.state);
  if (const auto one = withPiecesMerged(best.state, s.hypotheses)) {
    FitResult merged_state = s.quick.fit(*one, &s.tangents, FitOptions::closely());
    if (merged_state.bic < best.bic) {
      best = std::move(merged_state);
      s.linearise(best.state);
    }
  }
  const FitResult refined = s.refit(best, FitOptions::closely());
  // Derivatives are valid near the start of the fit.
  if (best.bic - refined.bic > s.options.far * refined.bic) {
    s.linearise(refined.state);
  } else {
    s.lineariseBy(std::move(s.tangents), refined.state);
  }
  s.now = s.withPhasesAligned(s.refit(refined, FitOptions::closely()));
  for (int pass = 0; pass < s.options.refit_passes; ++pass) {
    s.lineariseBy(std::move(s.tangents), s.now.state);
    if (s.bench.cancelled()) break;
    const double before = s.now.bic;
    s.now = s.refit(s.now, FitOptions::closely());
    if (before - s.now.bic < std::max(s.options.min_gain, s.options.min_share * s.excess(s.now))) break;
  }
}

}  // namespace smartmill::discrepancy
