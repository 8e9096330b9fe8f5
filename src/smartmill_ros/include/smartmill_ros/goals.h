#pragma once

#include <smartmill_msgs/MeasureFrfGoal.h>

#include "smartmill_core/modal/results.h"

namespace smartmill {

/// @param received [s] stands in for a missing stamp; only a stamped goal replays to the last digit
MeasureFrfGoal goalFromMsg(const smartmill_msgs::MeasureFrfGoal& message, double received);

}  // namespace smartmill
