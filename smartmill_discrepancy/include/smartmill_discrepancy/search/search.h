#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/cause_odds.h"
#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/results/tried_effect.h"
#include "smartmill_discrepancy/search/workbench.h"

namespace smartmill::discrepancy {

struct SearchOptions {
  std::size_t fitted_per_round = 5;  ///< hypotheses that a round fits after screening
  std::size_t most_effects = 8;
  double least_gain = 100.0;  ///< [1] difference of BIC below which nothing is named
  double least_prior_gain =
      3.0;  ///< [1] the same where it comes from nominal values that need not be pulled off any more
  double twin_accuracy = 2e-4;     ///< [1] of the signal, by which two faithful simulations differ
  double least_share = 0.05;       ///< [1] of the squares above the noise that an effect must take
  std::optional<CauseOdds> prior;  ///< between names that the records do not part; names nothing
  std::function<void(const std::string&)> progress;
  /// Told after each stage which share of the work is done, should nothing more be found.
  std::function<void(double share)> course;

  void say(const std::string& line) const {
    if (progress) progress(line);
  }
  void tell(double share) const {
    if (course) course(share);
  }
};

/// An effect as it was fitted in a round.
struct Rung {
  TriedEffect tried;
  const Hypothesis* hypothesis = nullptr;
  std::vector<double> values;  ///< as fitted then
};

/// Another effect fitted in the place of a member.
struct Rival {
  std::size_t member = 0;
  std::string effect;
  double delta_bic = 0.0;  ///< against the model without the member
  FitState state;
};

struct SearchResult {
  Fit null;  ///< nominal values only, on the fit tests
  Fit best;  ///< with the effects found
  std::vector<Rung> ladder;
  std::vector<double> contribution;  ///< of each member: BIC that is lost without it, others fitted again
  std::vector<bool> needed;          ///< whether that is enough to name it
  std::vector<FitState> lacking;     ///< the model without each member, others fitted again
  std::vector<Rival> rivals;
  std::vector<const Hypothesis*> refused;  ///< took the shape of something else: held-out tests deny them

  /// The ladder says what was taken: one effect in the place of another.
  void tellSwapped(const Hypothesis& old, const Hypothesis& better);

  /// Back to the nominal values alone.
  void forgetMembers() {
    best = null;
    contribution.clear();
    needed.clear();
    lacking.clear();
    rivals.clear();
  }
};

/// Forward addition of effects with re-fitting and pruning, on the fit tests. Cancelled, it ends with what it
/// has found.
/// @throws Error where the twin gives no numbers for the nominal model.
SearchResult search(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                    const SearchOptions& options);

}  // namespace smartmill::discrepancy
