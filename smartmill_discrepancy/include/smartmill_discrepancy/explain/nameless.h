#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "smartmill_discrepancy/explain/bent_law.h"
#include "smartmill_discrepancy/explain/explain.h"
#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/standing.h"

namespace smartmill::discrepancy {

/// When a cause without a name is taken into the model. Everything is asked of tests that took no part in its
/// fit, since a form without a name fits whatever it is shown.
struct NamelessOptions {
  std::size_t most = 6;
  std::size_t fitted = 4, fitted_instead = 3, examined = 2;  ///< forms a round
  double least_share = 0.05;  ///< [1] of the squares above the noise of the fit tests
  /// [1] of that share it must take of the held-out tests, and of what it changes in them; of the gain there
  /// the change must be as much
  double least_repeated = 0.5;
  double least_deviations = 3.0;    ///< of the gain, by its scatter from revolution to revolution
  double most_contradicted = 0.15;  ///< [1] of the gain, that one test may lose clearly
};

/// Builds effects from what the catalogue leaves: forms in which something may act at one stage (chip, edge,
/// time in cut, channel), screened and fitted as effects with a name are, and taken only where they repeat.
class Nameless {
 public:
  /// @param bench, options, structure must outlive this, and this every state that holds its effects
  Nameless(Workbench& bench, const ExplainOptions& options, const StructureOptions& structure)
      : bench_(bench), options_(options), structure_(structure) {}

  /// Adds what repeats; an effect with a name that is not needed beside it any more falls away.
  /// @param found receives the effects @param unexplained what effects with a name leave of the fit tests
  /// @return the state with these alone; nothing when none was added
  std::optional<FitState> extend(SearchResult* found, std::vector<Finding>* unexplained);

 private:
  bool addOne(SearchResult* found, const std::vector<Finding>& unexplained);
  bool addRevolution(SearchResult* found, double least);
  void settleRevolution(const std::vector<double>& turns, SearchResult* found);
  bool leaveOut(std::size_t member, SearchResult* found);
  void takeLess(std::size_t member, const Fit& less, SearchResult* found);
  void say(const std::string& what, const Standing& standing) const;
  void bendRevolution(const std::vector<std::size_t>& cuts, SearchResult* found);
  std::optional<Fit> withBend(FitState state, const Bend& bend);
  Standing weightedStanding(const FitState& better, const FitState& other) const;
  FitState turned(FitState state, const std::vector<double>& by) const;
  void putTable(Fit with, SearchResult* found) const;
  std::vector<Fit> fitsBeside(const Fit& now, const NominalTangents& tangents, double promised, double least,
                              std::size_t most, SearchResult* found, ScreeningMemory* memory) const;
  std::vector<Fit> fitsInstead(SearchResult* found, ScreeningMemory* memory) const;
  bool takeOne(std::vector<Fit> fits, const FitState& before, SearchResult* found) const;
  bool take(const Fit& start, const FitState& before, SearchResult* found) const;
  Fit fitted(const FitState& state) const;
  std::pair<std::vector<double>, std::vector<double>> leftOf(const FitState& state) const;
  bool repeats(const FitState& before, const Fit& with) const;
  Fit withoutNeedless(Fit fit, const NominalTangents& tangents) const;

  Workbench& bench_;
  const ExplainOptions& options_;
  const StructureOptions& structure_;
  NamelessOptions rule_;
  bool tried_instead_ = false;                 // a form in the place of all names
  std::deque<std::vector<Hypothesis>> forms_;  // of each round: states point to them
};

}  // namespace smartmill::discrepancy
