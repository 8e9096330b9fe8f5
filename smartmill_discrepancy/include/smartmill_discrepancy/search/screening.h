#pragma once

#include <map>
#include <vector>

#include <Eigen/Core>

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

/// What hypotheses did when they were simulated last, thinned out: what one does changes little from one
/// state to the next, so that one that comes nowhere near to what is due need not be simulated again.
using ScreeningMemory = std::map<const Hypothesis*, std::vector<Eigen::MatrixXf>>;  // of each probe

/// Score test of each hypothesis at a fitted state. Best first; hypotheses without any trace in the data come
/// last.
/// @param tangents of the nominal values at the state
/// Cancelled, it ends with those that it has come to.
/// @param tried simulated one by one or in groups; may hold effects that are members already: those are
/// passed over
/// @param due gain below which a promise is of no use @param memory of the same runner and tried; those that
/// it says promise far less have a rough gain and no start
std::vector<Promise> screen(const Fitter& fitter, const Fit& now, const NominalTangents& tangents,
                            const std::vector<Hypothesis>& tried, double due, ScreeningMemory* memory);

/// The promise is linear: of shorter ways from the null point to its start the one that fits best.
std::vector<double> bestStart(const Fitter& fitter, const Fit& now, const Promise& promise);

}  // namespace smartmill::discrepancy
