#pragma once

#include <string>

#include "smartmill_discrepancy/results/explanation.h"

namespace smartmill::discrepancy {

/// Terminal output of explain: verdict, effects, unexplained findings and gap, one line each.
std::string summaryOf(const Explanation& explanation);

}  // namespace smartmill::discrepancy
