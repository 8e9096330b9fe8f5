#pragma once

#include <optional>
#include <vector>

#include "smartmill_discrepancy/search/screening.h"

namespace smartmill::discrepancy {

/// Values at which a hypothesis reproduces the tooth radii of a member as closely as possible, e.g. runout
/// instead of individually fitted radii. No value if one of both does not change radii.
std::optional<std::vector<double>> equivalentValues(const Fitter& fitter, const Member& member,
                                                    const Hypothesis& hypothesis);

/// Best of several starts, since the prediction is linear: full and shorter steps from the null point, and an
/// optional other one.
std::vector<double> bestStart(const Fitter& fitter, const FitResult& now, const PredictedGain& predicted,
                              const std::optional<std::vector<double>>& other = {});

}  // namespace smartmill::discrepancy
