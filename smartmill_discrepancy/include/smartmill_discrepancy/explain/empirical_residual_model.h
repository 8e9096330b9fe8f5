#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "smartmill_discrepancy/explain/empirical_candidates.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/explain/revolution_table_fit.h"

namespace smartmill::discrepancy {

struct EmpiricalResidualOptions {
  std::size_t max_effects = 6;                                ///< limits the time of an explanation
  std::size_t fits_in_addition = 4, fits_as_replacement = 3;  ///< per round; limit its time
  /// [1] of the required gain: predicted gain from which a form is fitted instead of the names. It starts far
  /// from its fit, where derivatives are inaccurate.
  double min_predicted_as_replacement = 0.1;
};

/// Builds effects from the residual that the catalogue leaves: forms that act at one stage (chip, edge, time
/// in cut, channel) are screened and fitted like catalogue effects and accepted only if held-out tests
/// reproduce them.
class EmpiricalResidualModel {
 public:
  /// @param bench, options, structure must outlive this object, and this object every state with its effects
  EmpiricalResidualModel(Workbench& bench, const ExplainOptions& options, const StructureOptions& structure)
      : bench_(bench),
        options_(options.search),
        structure_(structure),
        candidates_(bench, options.search),
        table_(bench, options.search, candidates_, forms_) {}

  /// Adds reproducible empirical effects; catalogue effects that are no longer needed are removed.
  /// @param found receives the effects @param unexplained findings in the residual of the catalogue effects
  /// @return state with the catalogue effects alone; nothing if no effect was added
  std::optional<FitState> extend(SearchResult* found, std::vector<Finding>* unexplained);

 private:
  bool addOne(SearchResult* found, const std::vector<Finding>& unexplained);
  std::vector<FitResult> fitsAsReplacement(SearchResult* found, ScreeningMemory* memory) const;
  FitResult fitTwice(const FitState& state) const;

  Workbench& bench_;
  const SearchOptions& options_;
  const StructureOptions& structure_;
  EmpiricalResidualOptions limits_;
  bool replacement_tried_ = false;  // one form instead of all catalogue effects
  FormStore forms_;
  EmpiricalCandidates candidates_;
  RevolutionTableFit table_;
};

}  // namespace smartmill::discrepancy
