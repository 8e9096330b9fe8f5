#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "smartmill_discrepancy/explain/empirical_candidates.h"
#include "smartmill_discrepancy/explain/nonlinear_chip_law.h"

namespace smartmill::discrepancy {

/// Hypotheses of an explanation that are not in the catalogue; states point to them.
using FormStore = std::deque<std::vector<Hypothesis>>;

/// Adds a table over one revolution: a residual without a simple form may still be synchronous with the
/// spindle.
class RevolutionTableFit {
 public:
  /// @param bench, options, candidates, forms must outlive this object
  RevolutionTableFit(Workbench& bench, const SearchOptions& options, const EmpiricalCandidates& candidates,
                     FormStore& forms)
      : bench_(bench), options_(options), candidates_(candidates), forms_(forms) {}

  /// @param least BIC gain @param found receives the table @return whether it was added
  bool add(SearchResult* found, double least);

 private:
  void refineTable(const std::vector<double>& alignment, SearchResult* found);
  bool dropIfUnneeded(std::size_t member, SearchResult* found);
  void removeMember(std::size_t member, const FitResult& less, SearchResult* found);
  void addFeedCurvature(const std::vector<std::size_t>& cuts, SearchResult* found);
  std::optional<FitResult> withTable(FitState state, const FeedCurvature& curvature);
  FitState realigned(FitState state, const std::vector<double>& by) const;
  void replaceTable(FitResult with, SearchResult* found) const;

  Workbench& bench_;
  const SearchOptions& options_;
  const EmpiricalCandidates& candidates_;
  FormStore& forms_;
};

}  // namespace smartmill::discrepancy
