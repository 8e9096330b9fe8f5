#include "smartmill_discrepancy/explain/empirical_residual_model.h"

#include <algorithm>
#include <iterator>

#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_discrepancy/explain/residual_localisation.h"

namespace smartmill::discrepancy {
namespace {

// Candidate forms, located in the residual.
std::vector<Hypothesis> formsFor(const TwinRunner& runner, const FitResult& now,
                                 const std::vector<Finding>& unexplained) {
  const std::vector<Hypothesis> all = empiricalHypotheses(runner.data());
  const std::vector<Hypothesis> placed = localisedForms(runner, all, now, unexplained);
  std::vector<Hypothesis> forms;
  std::copy_if(all.begin(), all.end(), std::back_inserter(forms),
               [](const Hypothesis& h) { return !h.probes.empty(); });
  forms.insert(forms.end(), placed.begin(), placed.end());
  return forms;
}

}  // namespace

// One empirical effect may replace several catalogue effects.
std::vector<FitResult> EmpiricalResidualModel::fitsAsReplacement(SearchResult* found,
                                                                 ScreeningMemory* memory) const {
  const FitState nominal{found->null.state.nominal, {}, found->best.state.alignment};
  const NominalTangents here = bench_.linearise(nominal);
  const FitResult now = bench_.quick().fit(nominal, &here, FitOptions::closely());
  if (!now.converged) return {};
  const double least = now.bic - found->best.bic;
  return candidates_.fitsInAddition(now, here, forms_.back(), limits_.min_predicted_as_replacement * least,
                                    least, limits_.fits_as_replacement, found, memory);
}

bool EmpiricalResidualModel::addOne(SearchResult* found, const std::vector<Finding>& unexplained) {
  forms_.push_back(formsFor(bench_.quick().runner(), found->best, unexplained));
  const FitState before = found->best.state;
  const NominalTangents tangents = bench_.linearise(before);
  const double least =
      std::max(options_.min_gain, options_.min_share * (found->best.chi2 - bench_.samples()));
  ScreeningMemory memory;
  const std::vector<FitResult> additions = candidates_.fitsInAddition(
      found->best, tangents, forms_.back(), candidates_.limits().min_predicted * least, least,
      limits_.fits_in_addition, found, &memory);
  const bool named = std::any_of(before.members.begin(), before.members.end(), [](const Member& m) {
    return !findEffect(m.hypothesis->effect)->empirical();
  });
  // One empirical effect instead of several names is the simpler model, unless the names leave almost
  // nothing.
  const bool unexplained_rest = found->best.chi2 > (1.0 + options_.negligible_excess) * bench_.samples();
  if (named && unexplained_rest && !replacement_tried_) {
    replacement_tried_ = true;
    const std::vector<FitResult> replacements = fitsAsReplacement(found, &memory);
    if (candidates_.acceptFirst(replacements, {before.nominal, {}, before.alignment}, found)) return true;
  }
  return candidates_.acceptFirst(additions, before, found) || table_.add(found, least);
}

FitResult EmpiricalResidualModel::fitTwice(const FitState& state) const {
  const NominalTangents first = bench_.linearise(state);
  const FitResult once = bench_.quick().fit(state, &first, FitOptions::closely());
  if (!once.converged) return once;
  const NominalTangents there = bench_.linearise(once.state);
  return bench_.quick().fit(once.state, &there, FitOptions::closely());
}

std::optional<FitState> EmpiricalResidualModel::extend(SearchResult* found,
                                                       std::vector<Finding>* unexplained) {
  FitState named = found->best.state;
  std::vector<Finding> findings = *unexplained;
  std::size_t added = 0;
  for (; added < limits_.max_effects && !findings.empty() && !bench_.cancelled(); ++added) {
    if (!addOne(found, findings)) break;
    findings = findStructure(bench_.fitted(), found->best.residual, structure_);
  }
  if (added == 0) return {};
  // Empirical effects count as unexplained; so does the part of removed catalogue effects.
  FitState named_part = found->best.state;
  named_part.members.erase(
      std::remove_if(named_part.members.begin(), named_part.members.end(),
                     [](const Member& m) { return findEffect(m.hypothesis->effect)->empirical(); }),
      named_part.members.end());
  if (named_part.members.size() == named.members.size()) return named;
  const FitResult rest = fitTwice(named_part);
  if (!rest.converged) return named;
  *unexplained = findStructure(bench_.fitted(), rest.residual, structure_);
  return rest.state;
}

}  // namespace smartmill::discrepancy
