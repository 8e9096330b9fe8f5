#pragma once

#include <vector>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/search/twins.h"

namespace smartmill::discrepancy {

struct RecordAlignmentOptions {
  /// [rad] Smaller rotations are left to the fits, which use all samples and free values; correcting them
  /// here would alternate between two solutions.
  double min_rotation = 0.05;
  int heldout_passes = 3;           ///< Gauss-Newton steps of held-out records, which converge quadratically
  double heldout_tolerance = 1e-4;  ///< [rad] of the last step
  double max_step = 0.3;            ///< [rad] range in which the derivatives of a rotation are valid
};

/// Alignment of the records of a campaign with the model.
class RecordAlignments {
 public:
  /// @param twins, fitter must outlive this object @param fitter of the fitted tests
  RecordAlignments(Twins& twins, const Fitter& fitter, const RecordAlignmentOptions& options = {});

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
  RecordAlignmentOptions options_;
  std::vector<TestData> loaded_;  // fitted tests as loaded
  bool phases_estimated_;
};

}  // namespace smartmill::discrepancy
