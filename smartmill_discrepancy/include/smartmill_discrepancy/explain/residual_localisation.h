#pragma once

#include <vector>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"
#include "smartmill_discrepancy/results/finding.h"

namespace smartmill::discrepancy {

/// Empirical forms located in the residual: lines at the findings, the best step of each channel, bursts at
/// the period of the envelope in the strongest band, resonances at their best frequency.
/// @param all forms of a campaign, including those without probes @param now fit whose residual is used
std::vector<Hypothesis> localisedForms(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                       const FitResult& now, const std::vector<Finding>& unexplained);

}  // namespace smartmill::discrepancy
