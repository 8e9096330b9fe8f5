#include "smartmill_ros/goals.h"

#include "smartmill_recording/conversion_templates.h"

namespace smartmill {

MeasureFrfGoal goalFromMsg(const smartmill_msgs::MeasureFrfGoal& message, double received) {
  MeasureFrfGoal goal;
  conversion::read(message, received, goal);
  return goal;
}

}  // namespace smartmill
