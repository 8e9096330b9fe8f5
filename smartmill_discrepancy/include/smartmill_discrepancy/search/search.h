#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/cause_odds.h"
#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/results/candidate_result.h"
#include "smartmill_discrepancy/search/workbench.h"

namespace smartmill::discrepancy {

struct SearchOptions {
  std::size_t fitted_per_round = 5;  ///< hypotheses fitted per round after screening
  std::size_t max_effects = 8;
  double min_gain = 100.0;           ///< [1] minimum BIC gain of a named effect
  std::size_t max_tension_fits = 3;  ///< of effects hidden in nominal values, which must be simulated
  double min_prior_gain = 3.0;       ///< [1] the same if it reduces prior tension
  /// [1] of the gain that a channel must have for its twin accuracy to count: where the fits agree, so do its
  /// errors.
  double min_channel_share = 0.05;
  double twin_accuracy = TWIN_ACCURACY;
  double min_share = 0.05;  ///< [1] of the squares above the noise: minimum of an effect
  /// [1] of the squares of the noise: excess below which records count as explained.
  double negligible_excess = 0.02;
  std::optional<CauseOdds> prior;  ///< of the effects, used for unidentifiable pairs only
  std::function<void(const std::string&)> on_log;
  /// Called after each stage with the share of the work done if nothing more is found.
  std::function<void(double share)> on_progress;

  /// Reduction of the priors' squares from which prior tension is reduced.
  double requiredPenaltyReduction() const { return 4.0 * min_prior_gain; }
  void log(const std::string& line) const {
    if (on_log) on_log(line);
  }
  void reportProgress(double share) const {
    if (on_progress) on_progress(share);
  }
};

/// A fitted hypothesis.
struct Candidate {
  CandidateResult result;
  const Hypothesis* hypothesis = nullptr;
  std::vector<double> values;  ///< of its own fit
};

/// Another effect fitted instead of a member.
struct Alternative {
  std::size_t member = 0;
  std::string effect;
  double delta_bic = 0.0;  ///< against the model without the member
  FitState state;
};

struct SearchResult {
  FitResult null;  ///< nominal values only, on the fitted tests
  FitResult best;  ///< with the effects found
  std::vector<Candidate> candidates;
  std::vector<double> contribution;      ///< of each member: BIC lost without it after a refit
  std::vector<bool> is_needed;           ///< whether its contribution is significant
  std::vector<FitState> without_member;  ///< refitted model without each member
  std::vector<Alternative> alternatives;
  std::vector<const Hypothesis*> rejected;  ///< denied by held-out tests: they imitate another effect
  /// Of a cancelled search: neither fitted nor screened with too small a gain.
  std::vector<const Hypothesis*> not_tried;
  /// Members that were not validated next to an accepted empirical effect, since the work was ended.
  std::vector<const Hypothesis*> not_validated;

  /// Marks one effect as replaced by another among the candidates.
  void markReplaced(const Hypothesis& old, const Hypothesis& better);

  /// Back to the nominal values alone.
  void clearMembers() {
    best = null;
    clearComparisons();
  }
  /// Forgets what was measured of the members.
  void clearComparisons() {
    contribution.clear();
    is_needed.clear();
    without_member.clear();
    alternatives.clear();
  }
};

/// Forward selection of effects with refits and pruning, on the fitted tests. When cancelled, it returns the
/// effects found so far.
/// @throws Error if the twin gives no finite values for the nominal model.
SearchResult search(Workbench& bench, const std::vector<Hypothesis>& hypotheses,
                    const SearchOptions& options);

}  // namespace smartmill::discrepancy
