#pragma once

#include <smartmill_msgs/ForceCurve.h>

#include "smartmill_core/cutting/force_curve.h"

namespace smartmill {

smartmill_msgs::ForceCurve toMsg(const FoundCurves& curves);
/// @throws Error naming the field: lists that do not fit together, or fall.
FoundCurves fromMsg(const smartmill_msgs::ForceCurve& message);

}  // namespace smartmill
