#pragma once

#include <string>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// What of an effect without a name a machinist should know, and which law it follows where it follows one.
/// Empty for an effect of the catalogue.
std::string sentenceOf(const FoundEffect& effect);

/// The same of all of them, as one line.
std::string sentenceOf(const Explanation& explanation);

}  // namespace smartmill::discrepancy
