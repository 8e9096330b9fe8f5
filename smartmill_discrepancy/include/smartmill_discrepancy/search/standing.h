#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "smartmill_discrepancy/gap/asked.h"
#include "smartmill_discrepancy/search/workbench.h"

namespace smartmill::discrepancy {

/// How much of the way from one model to a better one a group of tests asks for. In test t the models differ
/// by d, the better one leaves r; both over the noise. The test itself asks for the share
/// a = 1 + d.r / d.d, and since
///
///     |r + d|^2 - |r|^2 = |d|^2 (2 a - 1)
///
/// the better model shrinks the gap of that test when a > 1/2; where a > 3/2 the test would be nearer still
/// with twice of it, and it is the size that the tests do not agree about. What it leaves is noise and
/// whatever it lacks besides; where the phases of that have nothing to do with those of d, d.r has the
/// variance sum_k |D_k|^2 |R_k|^2 over the frequencies: little where what is left lies elsewhere, much where
/// it lies just where d acts.
struct AskedShare {
  double share = 0.5;    ///< [1] for which the tests ask together: mean of the a, by |d|^2
  double std_dev = 0.0;  ///< [1] of it; where the tests differ by more than their variances say, as they do

  /// Standard deviations by which the tests ask for more than half and less than one and a half.
  double beyond() const { return (0.5 - std::abs(share - 1.0)) / std_dev; }
};

/// Of tests that tell the models apart; of none the deviation is infinite.
AskedShare sharedBy(const std::vector<AskedTest>& tests);

/// What each of a runner's tests asks for. @param between, left over the noise, laid out as its vectors
std::vector<AskedTest> askedIn(const TwinRunner& runner, const double* between, const double* left);

/// How one model stands against another in tests that it was not fitted to, and in those that it was.
struct Standing {
  /// Standard deviations by which each group asks for more than half and less than one and a half: few tests
  /// are held out, and the fit has not seen them; of the others there are many, and it has.
  static constexpr double HELDOUT_BEYOND = 1.0, FITTED_BEYOND = 3.0;

  AskedShare heldout;  ///< unknown (infinite deviation) where no held-out test tells the two apart
  AskedShare fitted;   ///< the stated uncertainty of the nominal values is one test more of these

  /// The group that is less sure of it.
  const AskedShare& weaker() const;
  /// Probability that the less sure group asks for more than half and less than one and a half.
  double confidence() const;
  bool holds() const;

  static bool holdsInFitted(const AskedShare& fitted) { return fitted.beyond() > FITTED_BEYOND; }
  /// Held-out tests ask for less than half of it as surely as they must ask for more where it is named.
  static bool isDenied(const AskedShare& heldout) {
    return 0.5 - heldout.share > HELDOUT_BEYOND * heldout.std_dev;
  }
  /// [1] Squares over the noise below which fit tests cannot be that sure: noise alone leaves a deviation of
  /// one over their root.
  static constexpr double tellingSquares() { return 4.0 * FITTED_BEYOND * FITTED_BEYOND; }
};

/// What the fit tests ask for of the way from one fit to a better one, as these two left them.
AskedShare fittedShare(const Fitter& fitter, const Fit& better, const Fit& other);

/// @param better, other states of the same campaign, both simulated exactly
Standing standingOf(const Workbench& bench, const FitState& better, const FitState& other);

/// [1] Share of the held-out squares above the noise that one model takes away from another's.
double heldoutReduction(const Workbench& bench, const FitState& better, const FitState& other);

}  // namespace smartmill::discrepancy
