#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// One way in which an effect of the catalogue may be present, e.g. gain_error of fx.
using Hypothesis = EffectForm;

/// All hypotheses that a campaign can speak of; the rest is named in notes with its reason.
std::vector<Hypothesis> catalogueHypotheses(const Dataset& data, std::vector<std::string>* notes);

/// All forms that a cause without a name may have in a campaign. Lines have no probe: where they lie only the
/// residual tells.
std::vector<Hypothesis> empiricalHypotheses(const Dataset& data);

}  // namespace smartmill::discrepancy
