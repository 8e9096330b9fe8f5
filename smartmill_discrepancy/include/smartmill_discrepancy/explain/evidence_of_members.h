#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_discrepancy/search/workbench.h"

namespace smartmill::discrepancy {

/// How an effect shows in the fit tests.
struct Trace {
  std::vector<double> values;  ///< what it adds to the records, over noise
  double total = 0.0;          ///< sum of their squares
  double evenness = 0.0;       ///< [1] variance over the tests of the size in which each shows it
};
Trace traceOf(const Fitter& fitter, const Fit& fit, std::size_t member);

/// [1] Share of the held-out squares above the noise that a member takes away.
double heldoutReduction(const Workbench& bench, const FitState& state, std::size_t member);

/// Probability that the tests as a body prefer one model to another, were they drawn anew: Vuong's comparison
/// of two models over the tests that tell them apart.
double confidenceBetween(const Fitter& fitter, const FitState& better, const FitState& other);

}  // namespace smartmill::discrepancy
