#pragma once

#include <cstddef>
#include <vector>

#include "search/search_state.h"

namespace smartmill::discrepancy {

/// Which hypotheses a round fits, and when a fit improves the model.
struct CandidateRoundOptions {
  /// [1] of the required gain: a weak hypothesis, whose predicted gain is below the required one, may gain
  /// more than the linear prediction.
  double weak = 0.25;
  double min_independent_share = 0.02;  ///< [1] of a weak hypothesis: nominal values can replace the rest
  /// [1] of the excess that the best fit leaves: weak hypotheses are fitted if no strong one removes much.
  double unremoved = 0.9;
  std::size_t max_weak = 2;  ///< weak hypotheses fitted per round; limits its time
  /// [1] of the largest predicted gain: smaller ones are fitted only among the first two.
  double min_of_largest = 0.02;
  /// [1] of the excess: a fit that leaves less can be surpassed only by a similar predicted gain.
  double almost_nothing = 0.02;
  /// [1] of the predicted gain of that fit.
  double similar = 0.5;
  /// [1] Effect scale and gain over the excess from which a fit without improvement is continued: the linear
  /// prediction was too short.
  double continued_scale = 1.25, continued_share = 0.1;
  std::size_t max_supported = 2;  ///< fits of hypotheses that only the fitted tests support
  /// [1] of the excess: a larger gain is an improvement by itself, a smaller one needs the fitted tests.
  double large_share = 0.25;
};

/// The fits of one round, each with one more effect than the current fit.
class CandidateRound {
 public:
  explicit CandidateRound(SearchState& state, const CandidateRoundOptions& options = {});

  /// Screens and fits. @param screened_again false: with the predictions of the last round
  void run(bool screened_again);

  bool improved() const { return improved_; }  ///< whether best() is a fit of this round
  FitResult& best() { return best_; }
  const std::vector<Candidate>& candidates() const { return candidates_; }

 private:
  bool isRejected(const Hypothesis* hypothesis) const;
  bool isWeak(const PredictedGain& predicted) const;
  bool isWorthFitting(const PredictedGain& predicted, double largest) const;
  void fitSupportedByTests();
  void fitHypothesis(const PredictedGain& predicted);
  FitResult continued(FitResult tried, const FitOptions& options) const;
  bool ranksAhead(const FitResult& tried) const;
  bool isImprovement(const FitResult& tried) const;

  SearchState& state_;
  CandidateRoundOptions options_;
  FitResult best_;
  double best_predicted_ = 0.0;
  double required_gain_;         // minimum BIC gain
  std::size_t weak_fitted_ = 0;  // fitted weak hypotheses
  bool improved_ = false;
  std::vector<Candidate> candidates_;
};

}  // namespace smartmill::discrepancy
