#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/explain/nonlinear_chip_law.h"
#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {

/// Acceptance of an empirical effect. An empirical form adapts to whatever it is fitted to, so each criterion
/// uses held-out tests.
struct EmpiricalResidualOptions {
  std::size_t max_effects = 6;
  std::size_t fits_in_addition = 4, fits_as_replacement = 3, examined_fits = 2;  ///< fits per round
  double min_share = 0.05;  ///< [1] of the squares above the noise of the fitted tests
  /// [1] minimum of the held-out share over the fitted share, and of the held-out gain over the squares of
  /// the change; its inverse is the maximum of the latter
  double min_reproduced = 0.5;
  double min_deviations = 3.0;  ///< of the gain, in standard deviations by its scatter over the revolutions
  double max_contradicted = 0.15;  ///< [1] share of the gain that a single test may lose significantly
};

/// Builds effects from the residual that the catalogue leaves: forms that act at one stage (chip, edge, time
/// in cut, channel) are screened and fitted like catalogue effects and accepted only if held-out tests
/// reproduce them.
class EmpiricalResidualModel {
 public:
  /// @param bench, options, structure must outlive this object, and this object every state with its effects
  EmpiricalResidualModel(Workbench& bench, const ExplainOptions& options, const StructureOptions& structure)
      : bench_(bench), options_(options), structure_(structure) {}

  /// Adds reproducible empirical effects; catalogue effects that are no longer needed are removed.
  /// @param found receives the effects @param unexplained findings in the residual of the catalogue effects
  /// @return state with the catalogue effects alone; nothing if no effect was added
  std::optional<FitState> extend(SearchResult* found, std::vector<Finding>* unexplained);

 private:
  bool addOne(SearchResult* found, const std::vector<Finding>& unexplained);
  bool addRevolutionTable(SearchResult* found, double least);
  void refineTable(const std::vector<double>& alignment, SearchResult* found);
  bool dropIfUnneeded(std::size_t member, SearchResult* found);
  void removeMember(std::size_t member, const FitResult& less, SearchResult* found);
  void logValidation(const std::string& what, const ValidationResult& validation) const;
  void addFeedCurvature(const std::vector<std::size_t>& cuts, SearchResult* found);
  std::optional<FitResult> withTable(FitState state, const FeedCurvature& curvature);
  ValidationResult validateWeighted(const FitState& better, const FitState& other) const;
  FitState realigned(FitState state, const std::vector<double>& by) const;
  void replaceTable(FitResult with, SearchResult* found) const;
  std::vector<FitResult> fitsInAddition(const FitResult& now, const NominalTangents& tangents,
                                        double min_predicted, double least, std::size_t most,
                                        SearchResult* found, ScreeningMemory* memory) const;
  std::vector<FitResult> fitsAsReplacement(SearchResult* found, ScreeningMemory* memory) const;
  bool acceptFirst(std::vector<FitResult> fits, const FitState& before, SearchResult* found) const;
  bool accept(const FitResult& start, const FitState& before, SearchResult* found) const;
  FitResult fitTwice(const FitState& state) const;
  std::pair<std::vector<double>, std::vector<double>> residualsOf(const FitState& state) const;
  bool isReproduced(const FitState& before, const FitResult& with) const;
  FitResult withoutUnneeded(FitResult fit, const NominalTangents& tangents) const;

  Workbench& bench_;
  const ExplainOptions& options_;
  const StructureOptions& structure_;
  EmpiricalResidualOptions criteria_;
  bool replacement_tried_ = false;             // one form instead of all catalogue effects
  std::deque<std::vector<Hypothesis>> forms_;  // of each round: states point to them
};

}  // namespace smartmill::discrepancy
