#pragma once

#include <string>
#include <vector>

#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {
namespace hammer {

struct BagReplay {
  std::vector<MeasureFrfResult> results;  ///< in order, failed ones too
  double fit_low = 0.0, fit_high = 0.0;   ///< [Hz] band of the fits
};

/// Puts a recorded session through the node's class: same results as live. @param parameters YAML of the
/// node; empty: defaults
/// @throws Error naming bag, model or parameter.
BagReplay replayBag(const std::string& bag, const std::string& model, const std::string& parameters);

}  // namespace hammer
}  // namespace smartmill
