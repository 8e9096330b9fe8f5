#pragma once

#include <functional>
#include <string>

#include "smartmill_kalman/compensation/compensation_method.h"
#include "smartmill_kalman/sensor/sensor_measurement.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibrator.h"

namespace smartmill::kalman {

/// Receivers of the results of a CompensationPipeline; empty ones are not called.
struct CompensationOutputs {
  ForceOutputs force;
  std::function<void(const StrikeCommand&)> strike = {};
  std::function<void(const TapFeedback&)> feedback = {};
  std::function<void(const SensorResult&)> result = {};
  std::function<void(const CalibrationResult&)> calibration = {};
  /// A block of the force sensor could not be compensated. Empty: the push() that released it throws.
  std::function<void(const std::string& reason)> block_error = {};
  /// Stamps jumped back (a recording was restarted); measured modes are dropped.
  std::function<void()> restart = {};
};

}  // namespace smartmill::kalman
