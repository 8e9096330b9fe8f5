#pragma once

#include "smartmill_kalman/sensor/spindle_sensor_calibrator.h"
#include "smartmill_recording/conversion/fields.h"

namespace smartmill::kalman {

/// From a goal of kalman/calibrate, of the action or of a recording. @param stamp [s] of its header
/// @param received [s], the stamp of a goal without one
template <class Goal>
CalibrationGoal calibrationGoal(const Goal& message, double stamp, double received) {
  constexpr double DEFAULT_DURATION = 0.5;  // [s] where the goal has 0
  CalibrationGoal goal;
  goal.stamp = stamp > 0.0 ? stamp : received;
  goal.step = static_cast<CalibrationGoal::Step>(message.step);
  goal.test = static_cast<int>(message.test);
  goal.length = message.length;
  goal.load = conversion::fromPoint(goal.step == CalibrationGoal::Step::point ? message.point : message.load);
  goal.reference = message.reference;
  goal.duration = message.duration == 0.0 ? DEFAULT_DURATION : message.duration;
  goal.file = message.file;
  return goal;
}

}  // namespace smartmill::kalman
