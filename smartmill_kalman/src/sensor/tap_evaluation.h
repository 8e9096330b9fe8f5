#pragma once

#include <vector>

#include "smartmill_kalman/sensor/sensor_measurement.h"

namespace smartmill::kalman {

/// FRF and modes of the force sensor from accepted hits; an error is in the result's code and message.
SensorResult evaluateTaps(const std::vector<Hit>& hits, const MeasureFrfGoal& goal,
                          const TapParameters& parameters);

}  // namespace smartmill::kalman
