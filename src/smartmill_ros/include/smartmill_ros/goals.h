#pragma once

#include <smartmill_msgs/MeasureFrfGoal.h>

#include "smartmill_core/modal/results.h"

namespace smartmill {

/// @param received [s] replaces a missing stamp; only a goal with stamp has an identical replay
MeasureFrfGoal goalFromMsg(const smartmill_msgs::MeasureFrfGoal& message, double received);

}  // namespace smartmill
