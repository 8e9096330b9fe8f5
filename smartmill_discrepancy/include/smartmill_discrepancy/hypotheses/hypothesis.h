#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// One form of an effect of the catalogue, e.g. gain_error of fx.
using Hypothesis = EffectForm;

/// All hypotheses that a campaign can test. @param untestable receives the others; nullptr: not of interest
std::vector<Hypothesis> catalogueHypotheses(const Dataset& data, std::vector<Untestable>* untestable);

/// All empirical forms of a campaign. Lines have no probe: their frequency follows from the residual.
std::vector<Hypothesis> empiricalHypotheses(const Dataset& data);

}  // namespace smartmill::discrepancy
