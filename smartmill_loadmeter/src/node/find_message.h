#pragma once

#include "smartmill_loadmeter/database/find_coefficients.h"
#include "smartmill_msgs/FindCoefficients.h"

namespace smartmill::loadmeter {

smartmill_msgs::FindCoefficients::Response toMsg(const FoundCoefficients& found);

}  // namespace smartmill::loadmeter
