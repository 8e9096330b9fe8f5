#pragma once

#include "smartmill_core/command.h"

namespace smartmill::kalman {

/// Force at the tool from the records of a force sensor.
Command compensateCommand();
/// FRFs of the tool or of the force sensor from cuts.
Command cuttingFrfCommand();
/// Transfer matrix of a force sensor and its checks.
Command sensorReportCommand();
/// Calibration of a spindle-integrated force sensor.
Command spindleSensorCommand();

}  // namespace smartmill::kalman
