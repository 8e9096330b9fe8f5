#pragma once

#include <vector>

#include "smartmill_discrepancy/fit/fit.h"
#include "smartmill_discrepancy/hypotheses/hypothesis.h"
#include "smartmill_discrepancy/results/finding.h"

namespace smartmill::discrepancy {

/// Forms of causes without a name that have a place in frequency or time, at the places where a residual
/// shows some: lines at the findings, the step that takes most from each channel, the train of bursts by the
/// envelope of the strongest band.
/// @param all forms of a campaign, those without probes among them @param now its residual
std::vector<Hypothesis> placedForms(const TwinRunner& runner, const std::vector<Hypothesis>& all,
                                    const Fit& now, const std::vector<Finding>& unexplained);

}  // namespace smartmill::discrepancy
