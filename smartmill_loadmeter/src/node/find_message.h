#pragma once

#include "smartmill_loadmeter/database/find_coefficients.h"
#include "smartmill_msgs/FindCoefficients.h"

namespace smartmill::loadmeter {

smartmill_msgs::FindCoefficients::Response toMsg(const FoundCoefficients& found);

/// Candidates of a request. @param tests of the request. @throws Error if their lists differ in length.
CutChoiceRequest choiceOf(const smartmill_msgs::FindCoefficients::Request& request,
                          std::vector<CuttingCondition> tests);
void fill(const CutChoice& choice, smartmill_msgs::FindCoefficients::Response* response);

}  // namespace smartmill::loadmeter
