#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "smartmill_discrepancy/gap/scale_evidence.h"
#include "smartmill_discrepancy/search/workbench.h"

namespace smartmill::discrepancy {

/// Factor on the change from one model to a better one that a group of tests prefers. In test t the models
/// differ by d, and the better one has the residual r, both over the noise. The test prefers the scale a = 1
/// + d.r / d.d, and since
///    |r + d|^2 - |r|^2 = |d|^2 (2 a - 1)
/// the better model reduces the gap of that test if a > 1/2; if a > 3/2 the change is too small by more than
/// half, and the tests disagree about its size. The residual is noise and missing effects. If its phases are
/// independent of those of d, d.r has the variance sum_k |D_k|^2 |R_k|^2 over the frequencies: large only
/// where residual and change overlap.
struct EffectScale {
  double scale = 0.5;    ///< [1] common scale of the tests: mean of a, weighted by |d|^2
  double std_dev = 0.0;  ///< [1] of the scale; from the scatter of the tests if that is larger

  /// Distance of the scale from the nearer of 1/2 and 3/2, in standard deviations; positive in between.
  double margin() const { return (0.5 - std::abs(scale - 1.0)) / std_dev; }
};

/// Of tests that distinguish the models; the standard deviation is infinite without any.
EffectScale effectScaleOf(const std::vector<ScaleEvidence>& tests);

/// Evidence of each of a runner's tests. @param change, residual over the noise, in the layout of its vectors
std::vector<ScaleEvidence> scaleEvidenceIn(const TwinRunner& runner, const double* change,
                                           const double* residual);

/// Effect scale of a better model against another one in held-out and in fitted tests.
struct ValidationResult {
  /// Required margin of each group: held-out tests are few and independent of the fit, fitted tests are many
  /// and part of it.
  static constexpr double HELDOUT_MARGIN = 1.0, FITTED_MARGIN = 3.0;

  EffectScale
      heldout;         ///< unknown (infinite standard deviation) if no held-out test distinguishes the models
  EffectScale fitted;  ///< the priors of the nominal values count as one more test

  /// The group with the smaller relative margin.
  const EffectScale& weakerGroup() const;
  /// Probability that the scale of the less certain group is between 1/2 and 3/2.
  double confidence() const;
  bool isAccepted() const;
  std::string text() const;  ///< both scales, for the log

  static bool isAcceptedByFitted(const EffectScale& fitted) { return fitted.margin() > FITTED_MARGIN; }
  /// Whether held-out tests prefer less than half of the change, by the margin required for acceptance.
  static bool isRejected(const EffectScale& heldout) {
    return 0.5 - heldout.scale > HELDOUT_MARGIN * heldout.std_dev;
  }
  /// [1] Squares over the noise below which fitted tests cannot reach the margin: noise alone has a standard
  /// deviation of one over their root.
  static constexpr double requiredSquares() { return 4.0 * FITTED_MARGIN * FITTED_MARGIN; }
};

/// Effect scale of the fitted tests for the change from `other` to `better`.
EffectScale fittedScale(const Fitter& fitter, const FitResult& better, const FitResult& other);

/// @param better, other states of the same campaign, both simulated exactly
ValidationResult validate(const Workbench& bench, const FitState& better, const FitState& other);

/// [1] Share of the squares above the noise that one model removes from another's.
/// @param better, other residuals of both over the noise
double reductionOf(const std::vector<double>& better, const std::vector<double>& other);

}  // namespace smartmill::discrepancy
