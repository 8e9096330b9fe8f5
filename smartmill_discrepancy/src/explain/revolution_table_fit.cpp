#include "smartmill_discrepancy/explain/revolution_table_fit.h"

#include <utility>

#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/explain/revolution_table.h"

namespace smartmill::discrepancy {

bool RevolutionTableFit::add(SearchResult* found, double least) {
  if (hasRevolutionTable(found->best.state)) return false;
  const TwinRunner& runner = bench_.quick().runner();
  const std::vector<std::size_t> cuts = cutsOfVaryingFeed(runner);
  if (cuts.empty() || bench_.cancelled()) return false;
  bench_.alignment().alignTo(found->best.state);
  const auto law =
      identifyChipLaw(runner, cuts, bench_.data().nominal, bench_.quick().model(found->best.state));
  const FitState state = law ? realigned(found->best.state, law->phase_shift) : found->best.state;
  const NominalTangents tangents = bench_.linearise(state);
  const FitResult now = bench_.quick().fit(state, &tangents, FitOptions::toEvaluate());
  if (!now.converged) return false;
  const auto table = revolutionTable(runner, empiricalHypotheses(runner.data()), now);
  if (!table) return false;
  forms_.push_back({*table});
  ScreeningMemory memory;
  const std::vector<FitResult> fits = candidates_.fitsInAddition(
      now, tangents, forms_.back(), candidates_.limits().min_predicted * least, least, 1, found, &memory);
  if (!candidates_.acceptFirst(fits, found->best.state, found)) return false;
  refineTable(state.alignment, found);
  for (std::size_t m = 0; m + 1 < found->best.state.members.size();) {
    if (!dropIfUnneeded(m, found)) ++m;
  }
  if (law) addFeedCurvature(cuts, found);
  return true;
}

// The fit used unweighted samples and moved values towards asynchronous parts; the table is estimated again
// with its own weights.
void RevolutionTableFit::refineTable(const std::vector<double>& alignment, SearchResult* found) {
  const TwinRunner& runner = bench_.quick().runner();
  FitState state = found->best.state;
  state.alignment = alignment;
  const NominalTangents before = bench_.linearise(state);
  FitResult here = bench_.quick().fit(state, &before, FitOptions::toEvaluate());
  if (!here.converged) return;
  const auto refined = revolutionTable(runner, empiricalHypotheses(runner.data()), here);
  if (!refined) return;
  forms_.push_back({*refined});
  state.members.back() = {&forms_.back().front(), {1.0}};
  const NominalTangents tangents = bench_.linearise(state);
  here = bench_.quick().fit(state, &tangents, FitOptions::toEvaluate());
  if (here.converged) replaceTable(std::move(here), found);
}

// Adds phase shifts to records without measured angle.
FitState RevolutionTableFit::realigned(FitState state, const std::vector<double>& by) const {
  const std::vector<Fitter::FreeAlignment>& alignment = bench_.quick().alignment();
  state.alignment.resize(alignment.size(), 0.0);
  for (std::size_t k = 0; k < alignment.size(); ++k) {
    if (alignment[k].freedom.value == &RecordAlignment::phase) state.alignment[k] += by[alignment[k].chosen];
  }
  return state;
}

// Replaces the revolution table, the last member.
void RevolutionTableFit::replaceTable(FitResult with, SearchResult* found) const {
  const Member& table = with.state.members.back();
  const Hypothesis* const old = found->best.state.members.back().hypothesis;
  for (std::size_t m = 0; m + 1 < with.state.members.size() && m < found->without_member.size(); ++m) {
    for (Member& other : found->without_member[m].members) {
      if (other.hypothesis == old) other = table;
    }
  }
  found->contribution.back() += found->best.bic - with.bic;
  found->best = std::move(with);
}

// Removes a catalogue effect unless the tests accept it in addition to a table fitted without it.
// @return false: it remains
bool RevolutionTableFit::dropIfUnneeded(std::size_t member, SearchResult* found) {
  const FitState now = found->best.state;
  if (bench_.cancelled()) {
    found->not_validated.push_back(now.members[member].hypothesis);
    return false;
  }
  const FitState bare = without(without(now, now.members.size() - 1), member);
  const std::optional<FitResult> less = withTable(bare, {});
  if (!less) return false;
  const std::string title = now.members[member].hypothesis->title();
  const ValidationResult validation =
      candidates_.reproduction().validateWeighted(now, less->state, title + " with the table");
  const bool stays = validation.isAccepted();
  if (!stays) removeMember(member, *less, found);
  bench_.alignment().alignTo(found->best.state);
  return !stays;
}

void RevolutionTableFit::removeMember(std::size_t member, const FitResult& less, SearchResult* found) {
  options_.log("  no longer needed: " + found->best.state.members[member].hypothesis->title());
  const auto at = static_cast<std::ptrdiff_t>(member);
  found->contribution.erase(found->contribution.begin() + at);
  found->is_needed.erase(found->is_needed.begin() + at);
  found->alternatives.clear();
  found->best = less;
  found->without_member.clear();
  const NominalTangents tangents = bench_.linearise(less.state);
  for (std::size_t m = 0; m < less.state.members.size(); ++m) {
    const FitResult rest = bench_.quick().fit(without(less.state, m), &tangents, FitOptions::toCompare());
    found->without_member.push_back(rest.state);
    found->contribution[m] = rest.bic - less.bic;
  }
}

// Adds the curvature of the nonlinear chip law to the table if the tests accept it.
void RevolutionTableFit::addFeedCurvature(const std::vector<std::size_t>& cuts, SearchResult* found) {
  const FitState linear_table = found->best.state;
  const FitState bare = without(linear_table, linear_table.members.size() - 1);
  bench_.alignment().alignTo(linear_table);
  const auto law =
      identifyChipLaw(bench_.quick().runner(), cuts, bench_.data().nominal, bench_.quick().model(bare));
  if (!law) return;
  const auto describe = [](const ChipLaw& l) {
    return formatted("exponent %.2g, edge force %.2g of the model with onset %.3g um", l.exponent,
                     l.edge_share, l.onset / units::UM);
  };
  options_.log(formatted(
      "  nonlinear chip law: %s; axial force: %s; weighted squares of the lines %.4g (linear %.4g)",
      describe(law->in_plane).c_str(), describe(law->axial).c_str(), law->squares, law->linear_squares));
  const bool significant = law->linear_squares - law->squares >= law->requiredReduction();
  if (!law->isNonlinear() || !significant || bench_.cancelled()) return;
  std::optional<FitResult> with = withTable(bare, law->curvature);
  if (!with || !candidates_.reproduction().isReproduced(bare, *with)) return;
  const ValidationResult validation =
      candidates_.reproduction().validateWeighted(with->state, linear_table, "table with curvature");
  // The law was chosen on the fitted tests, so only the held-out tests decide.
  if (validation.heldout.margin() > ValidationResult::HELDOUT_MARGIN) replaceTable(std::move(*with), found);
  bench_.alignment().alignTo(found->best.state);
}

// A state with a revolution table and curvature.
std::optional<FitResult> RevolutionTableFit::withTable(FitState state, const FeedCurvature& curvature) {
  const NominalTangents tangents = bench_.linearise(state);
  const FitResult bare = bench_.quick().fit(state, &tangents, FitOptions::toEvaluate());
  if (!bare.converged) return {};
  const TwinRunner& runner = bench_.quick().runner();
  const auto table = revolutionTable(runner, empiricalHypotheses(runner.data()), bare, curvature);
  if (!table) return {};
  forms_.push_back({*table});
  state.members.push_back({&forms_.back().front(), {1.0}});
  const NominalTangents here = bench_.linearise(state);
  FitResult with = bench_.quick().fit(state, &here, FitOptions::toEvaluate());
  if (!with.converged) return {};
  return with;
}

}  // namespace smartmill::discrepancy
