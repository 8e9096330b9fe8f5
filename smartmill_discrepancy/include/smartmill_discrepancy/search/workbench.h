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
  int screening_substeps = 1;  ///< more where nothing guides the modes of a tool
  int final_substeps = 8;
  std::function<bool()> cancelled;  ///< asked now and then; true ends every fit where it stands
};

/// A campaign with what simulates and fits it: a quick and an exact twin of the tests to be fitted, and an
/// exact one of the held-out tests. The quick twin is made equal to the exact one where the search stands.
class Workbench {
 public:
  Workbench(const Dataset& data, const WorkbenchOptions& options);
  Workbench(const Workbench&) = delete;
  Workbench& operator=(const Workbench&) = delete;

  const Dataset& data() const { return data_; }
  const NominalFreedom& freedom() const { return freedom_; }
  const Fitter& quick() const { return quick_; }
  const Fitter& exact() const { return exact_; }
  /// Exact twin of the fit tests, guided where fits are.
  const TwinRunner& fitted() const { return guided_ ? guided_runner_ : exact_runner_; }
  const TwinRunner& heldout() const { return heldout_runner_; }  ///< exact twin of the held-out tests
  const WorkbenchOptions& options() const { return options_; }
  bool cancelled() const { return options_.cancelled && options_.cancelled(); }

  /// Samples of the fit tests that count.
  double samples() const { return exact_runner_.counts(); }

  /// Makes the quick twin equal to the exact one at a state and takes the nominal tangents there.
  /// @param exact_squares receives what the exact twin leaves there; may be nullptr
  NominalTangents linearise(const FitState& state, double* exact_squares = nullptr);
  /// The same with the tangents of another state, which serve a fit on its way.
  NominalTangents lineariseBy(NominalTangents tangents, const FitState& state,
                              double* exact_squares = nullptr);

  /// From here on samples count by what the exact twin leaves of them at a state, fit and held-out tests each
  /// by their own (gap/whitening.h): what follows upon another tells nothing new. The records are turned
  /// there. @return false, and nothing has changed: all of it is noise as stated; or a guided twin, which no
  /// free one follows, has part of the records on both sides, so that what is left is not noise beside what
  /// it says
  bool weighBy(const FitState& state);
  /// Every sample alike, by its noise, as the gap is told.
  void weighAlike();

  /// Whether some cut of a tool with modes shows its displacement: such tools are searched guided by it, so
  /// that no candidate runs away, and judged freely.
  bool canGuide() const { return can_guide_; }
  bool guided() const { return guided_; }
  void guide(bool guided);

  /// Guided cuts are trusted as far as a state predicts them, those that chatter from the beginning on.
  void trustAt(const FitState& state);
  /// Where the search is not guided: cuts of which free simulation leaves clearly more than a guided one are
  /// guided from here on (near its limit a tool rings on in free simulation at what any small error has
  /// begun). Until guide().
  void guideNearLimit(const FitState& state);

  /// What the exact twin leaves of the fit tests at a state.
  double exactSquares(const FitState& state);
  /// The same with the records where they lie now.
  double exactSquaresHere(const FitState& state) const;
  /// What the exact twin leaves that nothing guides.
  double freeSquares(const FitState& state);

  /// Smaller steps for the quick twin. @return false: they are as small as the exact one's
  bool refineQuick();

  bool phasesEstimated() const { return phases_estimated_; }  ///< some records have no spindle angle

  /// Turns the records without spindle angle, of the state and held out, to where the lines of the state's
  /// forces say, where it then fits better: another tooth, another turn in air; not by what fits find
  /// themselves. @return by how much [rad], 0: not at all
  double turnPhases(FitState& state);

  /// The records lie where a state has them, those held out where it fits them best.
  void turnTo(const FitState& state);

 private:
  void turnFitted(const FitState& state);
  void readGuidance();
  void correctAt(const FitState& state, double* exact_squares);

  // The last tangents: the search comes back to where it stood. They hold as long as the quick twin says the
  // same there: not where records lie elsewhere, steps are others, or what is compared is weighed anew.
  struct Taken {
    FitState state;
    SimulatedBlocks said;
    NominalTangents tangents;
  };
  WorkbenchOptions options_;
  Dataset data_;                  // its records without spindle angle are turned as the model becomes better
  std::vector<TestData> loaded_;  // those to be fitted, as they were loaded
  NominalFreedom freedom_;
  bool phases_estimated_;
  bool can_guide_, guided_ = false, refined_ = false;
  TwinRunner quick_runner_, exact_runner_, guided_runner_, heldout_runner_;
  Fitter quick_, exact_;
  std::optional<Taken> taken_;
};

}  // namespace smartmill::discrepancy
