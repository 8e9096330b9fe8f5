#pragma once

#include <ros/time.h>

namespace smartmill {

/// [s] Wall time at the first call plus the time since then by a clock that is never set: for pauses, time
/// limits and paces, which a correction of the wall clock must not change.
inline double steadyTime() {
  static const double OFFSET = ros::WallTime::now().toSec() - ros::SteadyTime::now().toSec();
  return ros::SteadyTime::now().toSec() + OFFSET;
}

}  // namespace smartmill
