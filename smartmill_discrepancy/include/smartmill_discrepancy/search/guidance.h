#pragma once

#include "smartmill_discrepancy/search/record_alignments.h"
#include "smartmill_discrepancy/search/twins.h"

namespace smartmill::discrepancy {

/// Guidance of the simulated tool by its recorded displacement. A search is guided so that no candidate
/// diverges; results are compared freely.
class Guidance {
 public:
  /// @param twins, alignment, fitter must outlive this object
  Guidance(Twins& twins, RecordAlignments& alignment, const Fitter& fitter);

  /// Whether a cut of a tool with modes has a recorded displacement.
  bool isPossible() const { return is_possible_; }
  /// Whether the search is guided.
  bool isActive() const { return twins_.isGuided(); }
  void set(bool active);

  /// Sets the weights of guided cuts from their residual at a state; chattering cuts are guided from the
  /// beginning.
  void updateWeights(const FitState& state);
  /// If the search is not guided: guides cuts whose free simulation has a clearly larger residual than the
  /// guided one from now on (near its limit a tool keeps vibrating from any small error). Reset by set().
  void guideNearLimit(const FitState& state);

  /// Squares of the exact twin without guidance on the fitted tests at a state.
  double freeSquares(const FitState& state);

 private:
  bool markNearLimit(const TwinRunner& free, const std::vector<double>& freely,
                     const TwinRunner& guided_runner, const std::vector<double>& guided);

  Twins& twins_;
  RecordAlignments& alignment_;
  const Fitter& fitter_;
  bool is_possible_;
};

}  // namespace smartmill::discrepancy
