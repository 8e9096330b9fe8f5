#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_discrepancy/explain/reproduction.h"
#include "smartmill_discrepancy/search/screening.h"
#include "smartmill_discrepancy/search/search.h"

namespace smartmill::discrepancy {

/// Which fits of a round are made and examined.
struct EmpiricalCandidateOptions {
  /// [1] of the required gain: predicted gain from which a form is fitted, since forms are not proportional
  /// to their values.
  double min_predicted = 0.5;
  std::size_t examined_fits = 2;  ///< the best ones, since each is refined with the exact twin
};

/// Fits empirical forms like catalogue effects and accepts those that held-out tests reproduce.
class EmpiricalCandidates {
 public:
  /// @param bench, options must outlive this object
  EmpiricalCandidates(Workbench& bench, const SearchOptions& options)
      : bench_(bench), options_(options), reproduction_(bench, options) {}

  const EmpiricalCandidateOptions& limits() const { return limits_; }
  const Reproduction& reproduction() const { return reproduction_; }

  /// Fits the forms with the largest predicted gain in addition to a fit.
  /// @param forms must outlive the fits @param min_predicted, least predicted and BIC gain against that fit
  /// @param most fits @param found receives the candidates
  std::vector<FitResult> fitsInAddition(const FitResult& now, const NominalTangents& tangents,
                                        const std::vector<Hypothesis>& forms, double min_predicted,
                                        double least, std::size_t most, SearchResult* found,
                                        ScreeningMemory* memory) const;

  /// Accepts the first of the best fits that is reproduced; catalogue effects that it makes unnecessary are
  /// removed. @param before state without the form @param found receives the effects @return whether one was
  bool acceptFirst(std::vector<FitResult> fits, const FitState& before, SearchResult* found) const;

 private:
  bool accept(const FitResult& start, const FitState& before, SearchResult* found) const;

  Workbench& bench_;
  const SearchOptions& options_;
  EmpiricalCandidateOptions limits_;
  Reproduction reproduction_;
};

}  // namespace smartmill::discrepancy
