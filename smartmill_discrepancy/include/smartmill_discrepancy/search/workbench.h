#pragma once

#include <optional>

#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"
#include "smartmill_discrepancy/search/guidance.h"
#include "smartmill_discrepancy/search/record_alignments.h"
#include "smartmill_discrepancy/search/twins.h"

namespace smartmill::discrepancy {

/// A campaign with its twins and fitters. The quick twin is corrected to the exact one at the current state.
class Workbench {
 public:
  Workbench(const Dataset& data, const WorkbenchOptions& options);

  const Dataset& data() const { return twins_.data; }
  const NominalFreedom& freedom() const { return freedom_; }
  const Fitter& quick() const { return quick_; }
  const Fitter& exact() const { return exact_; }
  /// Exact twin of the fitted tests, guided if the fits are.
  const TwinRunner& fitted() const { return twins_.fitted(); }
  const TwinRunner& heldout() const { return twins_.heldout; }  ///< exact twin of the held-out tests
  const WorkbenchOptions& options() const { return options_; }
  bool cancelled() const { return options_.cancelled && options_.cancelled(); }

  /// Independent samples of the fitted tests.
  double samples() const { return twins_.exact.channels().effectiveSamples(); }

  RecordAlignments& alignment() { return alignment_; }
  Guidance& guidance() { return guidance_; }

  /// Corrects the quick twin to the exact one at a state and computes the nominal derivatives there.
  /// @param exact_squares receives the squares of the exact twin; may be nullptr
  NominalTangents linearise(const FitState& state, double* exact_squares = nullptr);
  /// The same with the derivatives of another state, for intermediate steps of a fit.
  NominalTangents lineariseBy(NominalTangents tangents, const FitState& state,
                              double* exact_squares = nullptr);

  /// Whitens all residuals by the residual of the exact twin at a state, fitted and held-out tests each by
  /// their own (gap/whitening.h), and aligns the records there.
  /// @return false, without change: the residual is white noise as stated, or the twin is guided, whose
  /// prediction contains part of the record
  bool whitenAt(const FitState& state);
  /// Removes the whitening: every sample counts by its noise, as in the gap.
  void clearWhitening();

  /// Squares of the exact twin on the fitted tests at a state.
  double exactSquares(const FitState& state);

 private:
  void correctAt(const FitState& state, double* exact_squares);

  // The last derivatives, valid while the quick twin gives the same values at the state: not after a change
  // of alignment, steps or whitening.
  struct LinearisedState {
    FitState state;
    SimulatedChannels simulated_there;
    NominalTangents tangents;
  };
  WorkbenchOptions options_;
  Twins twins_;
  NominalFreedom freedom_;
  Fitter quick_, exact_;
  RecordAlignments alignment_;
  Guidance guidance_;
  std::optional<LinearisedState> last_linearised_;
};

}  // namespace smartmill::discrepancy
