#pragma once

#include <string>
#include <vector>

#include "node/parameters.h"

namespace smartmill::hammer {

/// Replays a recorded session through the node's pipeline: same results as live.
/// @return all results in order, failed ones included. @throws Error naming bag, model or parameter.
std::vector<MeasureFrfResult> replayBag(const std::string& bag, const std::string& model,
                                        const NodeParameters& parameters);

}  // namespace smartmill::hammer
