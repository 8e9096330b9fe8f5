#pragma once

#include "sequence/sequence_step.h"

namespace smartmill::hammer {

/// Waits until the axes rest and stops the spindle at `start_angle`.
StepPtr orientSpindle(Measurement& measurement, StationControl& control);
StepPtr moveToStation(Measurement& measurement, StationControl& control);

/// Searches the flute at the tip; C of the thesis.
StepPtr searchFluteAtTip(Measurement& measurement, StationControl& control);
/// Lowers the tool so that the sensor is halfway between tip and hammer.
StepPtr lowerHalfway(Measurement& measurement, StationControl& control);
/// Searches the same flute halfway up to the hammer (B), which gives its angle at the hammer (A, eq. 4.1).
StepPtr searchFluteHalfway(Measurement& measurement, StationControl& control);
StepPtr raiseToTip(Measurement& measurement, StationControl& control);
StepPtr turnFluteToHammer(Measurement& measurement, StationControl& control);

/// Measures the flank that faces the sensor, and those to either side where the approach would end before
/// the sensor is at zero volt.
StepPtr measureFlanks(Measurement& measurement, StationControl& control);
/// One hit at the station's distance: how far the tool swings towards the sensor.
StepPtr trialHit(Measurement& measurement, StationControl& control);

StepPtr calibrateSensor(Measurement& measurement, StationControl& control);
/// Only where daq/hammer has a channel gap_cross.
StepPtr calibrateCrossSensor(Measurement& measurement, StationControl& control);
/// The jogs towards the second sensor have moved the round tool in front of the first.
StepPtr repeatCalibration(Measurement& measurement, StationControl& control);
/// Hits at the first height.
StepPtr collectHits(Measurement& measurement, StationControl& control);

/// Only where the tip correction uses two heights.
StepPtr lowerToSecondHeight(Measurement& measurement, StationControl& control);
StepPtr turnFluteAtSecondHeight(Measurement& measurement, StationControl& control);
StepPtr calibrateAtSecondHeight(Measurement& measurement, StationControl& control);
StepPtr collectHitsAtSecondHeight(Measurement& measurement, StationControl& control);

}  // namespace smartmill::hammer
