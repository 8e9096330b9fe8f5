#include "smartmill_ros/goals.h"

#include <algorithm>
#include <cstdint>

#include "smartmill_ros/conversions.h"

namespace smartmill {

MeasureFrfGoal goalFromMsg(const smartmill_msgs::MeasureFrfGoal& message, double received) {
  // Beyond any range that a measurement accepts, and safe as an int.
  const auto count = [](std::uint32_t n) { return static_cast<int>(std::min<std::uint32_t>(n, 1000000)); };
  MeasureFrfGoal goal;
  goal.stamp = message.header.stamp.isZero() ? received : toSec(message.header.stamp);
  goal.tool = message.tool;
  goal.point = message.point;
  goal.direction = message.direction;
  goal.hits = count(message.hits);
  goal.modes = count(message.modes);
  goal.stickout = message.stickout;
  goal.teeth = count(message.teeth);
  return goal;
}

}  // namespace smartmill
