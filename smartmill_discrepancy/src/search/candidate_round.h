#pragma once

#include <cstddef>
#include <vector>

#include "search/search_state.h"

namespace smartmill::discrepancy {

/// The fits of one round, each with one more effect than the current fit.
class CandidateRound {
 public:
  explicit CandidateRound(SearchState& state);

  /// Screens and fits. @param screened_again false: with the predictions of the last round
  void run(bool screened_again);

  bool improved() const { return improved_; }  ///< whether best() is a fit of this round
  FitResult& best() { return best_; }
  const std::vector<Candidate>& candidates() const { return candidates_; }

 private:
  bool isRejected(const Hypothesis* hypothesis) const;
  bool isTried(const Hypothesis* hypothesis) const;
  bool isWorthFitting(const PredictedGain& predicted) const;
  void fitSimplerOnes();
  void fitSupportedByTests();
  void fitHypothesis(const PredictedGain& predicted);
  void fitFrom(const PredictedGain& predicted, const std::vector<double>& start);
  bool ranksAhead(const FitResult& tried) const;
  bool isImprovement(const FitResult& tried) const;

  SearchState& state_;
  FitResult best_;
  double best_predicted_ = 0.0;
  double required_gain_;  // minimum BIC gain
  bool improved_ = false;
  std::vector<Candidate> candidates_;
};

}  // namespace smartmill::discrepancy
