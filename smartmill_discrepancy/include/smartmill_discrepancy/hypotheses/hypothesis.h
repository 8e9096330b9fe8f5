#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "smartmill_core/model/effect_form.h"
#include "smartmill_discrepancy/data/dataset.h"

namespace smartmill::discrepancy {

/// One form of an effect of the catalogue, e.g. gain_error of fx.
using Hypothesis = EffectForm;

/// In a note on an effect that a campaign cannot test, between its name and the reason.
inline constexpr std::string_view NOT_TESTED = " is not tested: ";

/// All hypotheses that a campaign can test; notes receives the others with the reason.
std::vector<Hypothesis> catalogueHypotheses(const Dataset& data, std::vector<std::string>* notes);

/// All empirical forms of a campaign. Lines have no probe: their frequency follows from the residual.
std::vector<Hypothesis> empiricalHypotheses(const Dataset& data);

}  // namespace smartmill::discrepancy
