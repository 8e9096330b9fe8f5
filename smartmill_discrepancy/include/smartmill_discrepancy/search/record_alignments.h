#pragma once

#include <vector>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/search/twins.h"

namespace smartmill::discrepancy {

/// Alignment of the records of a campaign with the model.
class RecordAlignments {
 public:
  /// @param twins, fitter must outlive this object @param fitter of the fitted tests
  RecordAlignments(Twins& twins, const Fitter& fitter);

  bool phasesEstimated() const { return phases_estimated_; }  ///< some records have no spindle angle

  /// Aligns records without spindle angle with the force lines of the state, where this reduces the residual:
  /// another tooth, another angle of an air cut. Small corrections are left to the fits.
  /// @return largest rotation [rad], 0: none
  double alignPhases(FitState& state);

  /// Gives the records the alignment of a state; held-out records are aligned by their best fit.
  void alignTo(const FitState& state);

  /// The same for the fitted records and their exact twins; the quick one keeps the alignment of its
  /// derivatives.
  void alignFitted(const FitState& state);

 private:
  double alignHeldoutOnce(const MachineModel& model);

  Twins& twins_;
  const Fitter& fitter_;
  std::vector<TestData> loaded_;  // fitted tests as loaded
  bool phases_estimated_;
};

}  // namespace smartmill::discrepancy
