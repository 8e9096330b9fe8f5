#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/gap/twin_runner.h"
#include "smartmill_discrepancy/hypotheses/nominal_freedom.h"

namespace smartmill::discrepancy {

struct WorkbenchOptions {
  int threads = 2;
  int screening_substeps = 1;  ///< increased for unguided tools with modes
  int final_substeps = 8;
  std::function<bool()> cancelled;  ///< polled; true ends every fit at its current step
};

/// A campaign with its twins and fitters: a quick and an exact twin of the fitted tests, and an exact one of
/// the held-out tests. The quick twin is corrected to the exact one at the current state.
class Workbench {
 public:
  Workbench(const Dataset& data, const WorkbenchOptions& options);
  Workbench(const Workbench&) = delete;
  Workbench& operator=(const Workbench&) = delete;

  const Dataset& data() const { return data_; }
  const NominalFreedom& freedom() const { return freedom_; }
  const Fitter& quick() const { return quick_; }
  const Fitter& exact() const { return exact_; }
  /// Exact twin of the fitted tests, guided if the fits are.
  const TwinRunner& fitted() const { return guided_ ? guided_runner_ : exact_runner_; }
  const TwinRunner& heldout() const { return heldout_runner_; }  ///< exact twin of the held-out tests
  const WorkbenchOptions& options() const { return options_; }
  bool cancelled() const { return options_.cancelled && options_.cancelled(); }

  /// Independent samples of the fitted tests.
  double samples() const { return exact_runner_.effectiveSamples(); }

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

  /// Whether a cut of a tool with modes has a recorded displacement: the search is then guided by it, so that
  /// no candidate diverges; results are compared freely.
  bool canGuide() const { return can_guide_; }
  bool guided() const { return guided_; }
  void setGuided(bool guided);

  /// Sets the weights of guided cuts from their residual at a state; chattering cuts are guided from the
  /// beginning.
  void updateWeights(const FitState& state);
  /// If the search is not guided: guides cuts whose free simulation has a clearly larger residual than the
  /// guided one from now on (near its limit a tool keeps vibrating from any small error). Reset by
  /// setGuided().
  void guideNearLimit(const FitState& state);

  /// Squares of the exact twin on the fitted tests at a state.
  double exactSquares(const FitState& state);
  /// The same with the current alignment of the records.
  double exactSquaresHere(const FitState& state) const;
  /// Squares of the exact twin without guidance.
  double freeSquares(const FitState& state);

  /// Smaller steps for the quick twin. @return false: they are those of the exact twin already
  bool refineQuick();

  bool phasesEstimated() const { return phases_estimated_; }  ///< some records have no spindle angle

  /// Aligns records without spindle angle with the force lines of the state, where this reduces the residual:
  /// another tooth, another angle of an air cut. Small corrections are left to the fits.
  /// @return largest rotation [rad], 0: none
  double alignPhases(FitState& state);

  /// Gives the records the alignment of a state; held-out records are aligned by their best fit.
  void alignTo(const FitState& state);

 private:
  void alignFitted(const FitState& state);
  void readGuidance();
  void correctAt(const FitState& state, double* exact_squares);

  // The last derivatives, valid while the quick twin gives the same values at the state: not after a change
  // of alignment, steps or whitening.
  struct LinearisedState {
    FitState state;
    SimulatedChannels simulated_there;
    NominalTangents tangents;
  };
  WorkbenchOptions options_;
  Dataset data_;                  // records without spindle angle are aligned again as the model improves
  std::vector<TestData> loaded_;  // fitted tests as loaded
  NominalFreedom freedom_;
  bool phases_estimated_;
  bool can_guide_, guided_ = false, refined_ = false;
  TwinRunner quick_runner_, exact_runner_, guided_runner_, heldout_runner_;
  Fitter quick_, exact_;
  std::optional<LinearisedState> last_linearised_;
};

}  // namespace smartmill::discrepancy
