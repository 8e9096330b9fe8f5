#pragma once

#include <map>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/search/validation.h"

namespace smartmill::discrepancy {

/// Predicted gain of a hypothesis from its derivatives, with nominal values and members free.
struct PredictedGain {
  const Hypothesis* hypothesis = nullptr;
  double gain = 0.0;          ///< reduction of chi2 in linear approximation
  bool approximate = false;   ///< from the previous simulation: only the gain is valid
  std::vector<double> start;  ///< coordinates from which a fit starts
  std::vector<double>
      null;  ///< point without effect from which start was reached; empty: start is used as it is
  /// Change of the simulation including all values that move with it, and residual without it, in the layout
  /// of the runner's vectors; nullptr: gain too small.
  std::shared_ptr<const Eigen::VectorXd> change, baseline_residual;
  ScaleEvidence prior_evidence;  ///< of the stated nominal values; its variance is not set
};

/// Derivatives of hypotheses from their last simulation, on thinned samples. They change little from one
/// state to the next, so hypotheses with a far too small gain are not simulated again.
struct ScreeningMemory {
  std::map<const Hypothesis*, std::vector<Eigen::MatrixXf>> columns;  ///< by probe
  /// Upper limits of the gain from a screening of shortened records: for the next screening.
  std::map<const Hypothesis*, double> gain_limits;

  void clear() {
    columns.clear();
    gain_limits.clear();
  }
};

/// Score test of each hypothesis at a fitted state, best first; hypotheses without any response come last.
/// When cancelled, it returns the predictions so far.
/// @param tangents of the nominal values at the state @param hypotheses existing members are skipped
/// @param required_gain smaller gains are of no use @param memory of the same runner and hypotheses; those
/// with a far smaller remembered gain are approximate and have no start
std::vector<PredictedGain> screen(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents,
                                  const std::vector<Hypothesis>& hypotheses, double required_gain,
                                  ScreeningMemory* memory);

/// Simulates the approximate predictions whose gain exceeds a minimum.
void screenRemembered(const Fitter& fitter, const FitResult& now, const NominalTangents& tangents,
                      double least, ScreeningMemory* memory, std::vector<PredictedGain>* predictions);

/// Predicted effect scale of the fitted tests, as of a fit.
EffectScale fittedScale(const Fitter& fitter, const PredictedGain& predicted);

}  // namespace smartmill::discrepancy
