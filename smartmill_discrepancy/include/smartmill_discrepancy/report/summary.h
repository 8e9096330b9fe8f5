#pragma once

#include <string>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// What explain says on the terminal: verdict, effects, what is left, gap; a line each.
std::string summaryOf(const Explanation& explanation);

}  // namespace smartmill::discrepancy
