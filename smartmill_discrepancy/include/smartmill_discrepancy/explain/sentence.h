#pragma once

#include <string>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Description of an empirical effect for the machinist, with the law that it follows if any. Empty for an
/// effect of the catalogue.
std::string sentenceOf(const FoundEffect& effect);

/// All empirical effects in one line.
std::string sentenceOf(const Explanation& explanation);

}  // namespace smartmill::discrepancy
