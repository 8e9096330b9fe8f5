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

/// What a search accepts and how long it tries. Each constant is a property of the method, not of a campaign;
/// those that only limit the time say so.
struct SearchOptions {
  // What is an effect
  std::size_t max_effects = 8;
  double min_gain = 100.0;  ///< [1] minimum BIC gain of a named effect
  double min_share = 0.05;  ///< [1] of the squares above the noise: minimum of an effect
  /// [1] of the excess: a larger gain is an improvement by itself, a smaller one needs the fitted tests.
  double large_share = 0.25;
  double twin_accuracy = TWIN_ACCURACY;
  /// [1] of the gain that a channel must have for its twin accuracy to count: where the fits agree, so do its
  /// errors.
  double min_channel_share = 0.05;
  double min_prior_gain = 3.0;  ///< [1] minimum BIC gain if it reduces prior tension
  /// [1] of the squares of the noise: excess below which records count as explained.
  double negligible_excess = 0.02;
  std::optional<CauseOdds> prior;  ///< of the effects, used for unidentifiable pairs only

  // Nominal values
  int nominal_passes = 3, fresh_nominal_passes = 2;  ///< later passes are close and reuse the derivatives
  double nominal_settled = 1e-3;                     ///< [1] of the cost: gain of the last pass
  /// The same for records without spindle angle: alignment is sensitive to the nominal values, so it needs
  /// tighter convergence.
  int nominal_passes_without_angle = 8;
  double nominal_settled_without_angle = 1e-6;
  /// [1] standard deviations from the stated values within which derivatives are taken: missing effects pull
  /// nominal values further away than they are wrong.
  double near_stated = 2.5;
  /// [1] Free over guided squares up to which the free simulation follows the records.
  double max_free_ratio = 2.0;

  // Alignment of records without spindle angle
  int alignment_passes = 4;     ///< of rotation and refit, which affect each other
  double large_rotation = 0.1;  ///< [rad] that invalidates remembered derivatives
  /// [1] of the excess: a smaller gain ends the alignment. Its last part is left to the fits.
  double negligible_alignment_gain = 0.01;

  // Which hypotheses a round fits
  std::size_t fitted_per_round = 5;  ///< after screening; limits the time
  /// [1] of the excess: a fit that leaves less can be surpassed only by a similar predicted gain.
  double almost_nothing = 0.02;
  double similar = 0.5;           ///< [1] of the predicted gain of that fit
  std::size_t max_supported = 2;  ///< fits of hypotheses that only the fitted tests support

  // Adoption of the best fit of a round
  int refit_passes = 4;  ///< with corrected twin
  /// [1] Gain over the squares beyond which a fit has left the range of its derivatives.
  double far = 0.01;
  /// [1] of the required gain: smaller gains of shortened records, in proportion to the samples, are not
  /// screened again on the whole ones.
  double worth_screening = 0.25;

  // Refinement
  int refinement_passes = 6;   ///< corrections of the quick twin at most
  double tolerance = 0.1;      ///< [1] standard deviations: change of a value in the last pass
  double same_tangents = 2.0;  ///< [1] standard deviations in which derivatives remain valid
  /// [1] standard deviations between a step and the linear optimum from which both are compared.
  double min_distance = 0.5;
  /// [1] of a round's largest gain: candidates with less are no alternatives, even after convergence.
  double near = 0.3;
  double min_overlap = 0.5;          ///< [1] of a member's effect that an alternative must have to replace it
  int max_swaps = 3;                 ///< of effects by alternatives; limits the time
  std::size_t max_tension_fits = 3;  ///< of effects hidden in nominal values, which must be simulated

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
