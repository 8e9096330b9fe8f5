#pragma once

#include <string>
#include <vector>

#include "node/parameters.h"

namespace smartmill {
namespace hammer {

/// Puts a recorded session through the node's class: same results as live.
/// @return in order, failed ones too. @throws Error naming bag, model or parameter.
std::vector<MeasureFrfResult> replayBag(const std::string& bag, const std::string& model,
                                        const NodeParameters& parameters);

}  // namespace hammer
}  // namespace smartmill
