#pragma once

#include <vector>

#include "smartmill_discrepancy/fit/fit.h"

namespace smartmill::discrepancy {

/// What a hypothesis promises, from its tangents beside those of the nominal values and of the effects found
/// so far.
struct Promise {
  const Hypothesis* hypothesis = nullptr;
  double gain = 0.0;  ///< chi2 that it takes away in linear approximation
  /// [1] Share of what it does that nominal values and members cannot stand for: where it is small, a gain
  /// says that they are off.
  double apart = 1.0;
  std::vector<double> start;  ///< coordinates to start a fit from
  std::vector<double>
      null;  ///< the point without effect that the start was reached from; empty: the start stands
};

/// Score test of each hypothesis at a fitted state. Best first; hypotheses without any trace in the data come
/// last.
/// @param tangents of the nominal values at the state
/// Cancelled, it ends with those that it has come to.
/// @param tried simulated one by one or in groups; may hold effects that are members already: those are
/// passed over
std::vector<Promise> screen(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                            const std::vector<Hypothesis>& tried);

/// The promise is linear: of shorter ways from the null point to its start the one that fits best.
std::vector<double> bestStart(const Fitter& fitter, const Fit& now, const Promise& promise);

}  // namespace smartmill::discrepancy
