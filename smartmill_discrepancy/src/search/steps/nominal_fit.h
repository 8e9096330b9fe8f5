#pragma once

#include <limits>
#include <vector>

#include "search/steps/search_step.h"

namespace smartmill::discrepancy {

struct NominalFitOptions {
  int fresh_passes = 2;   ///< with new derivatives; later passes are close to each other and reuse them
  int passes = 3;         ///< distant nominal values require new derivatives at each
  double settled = 1e-3;  ///< [1] of the cost: gain of the last pass
  /// The same for records without spindle angle: alignment is sensitive to the nominal values, so it needs
  /// tighter convergence.
  int passes_without_angle = 8;
  double settled_without_angle = 1e-6;
  FitOptions last{3, 1e-5};  ///< with the derivatives of the last pass, near its end
  /// [1] Squares of the guided first pass over those of the free fit above which guidance is given up.
  double give_up_ratio = 4.0;
};

/// Fits the nominal values without effects, freely and, if that leaves a residual and the tool's displacement
/// is recorded, guided.
class NominalFit : public SearchStep {
 public:
  /// @throws Error if the twin gives no finite values for the nominal model
  void run(SearchState& state) override;

  /// @param from start @param give_up_above squares at which the fit ends
  void fitFrom(SearchState& state, const std::vector<double>& from,
               double give_up_above = std::numeric_limits<double>::infinity()) const;

 private:
  void useStatedIfBetter(SearchState& state) const;

  NominalFitOptions options_;
};

}  // namespace smartmill::discrepancy
