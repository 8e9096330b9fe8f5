#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/modal/results.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/hit.h"
#include "smartmill_hammer/search/sensor_approach.h"
#include "smartmill_hammer/sequence/hammer_parameters.h"
#include "smartmill_hammer/sequence/measure_frf_result.h"
#include "station_paths.h"

namespace smartmill::hammer {

/// What the calibration of a sensor found.
struct SensorState {
  double sensitivity = NOT_A_NUMBER, sensitivity_std = NOT_A_NUMBER;  ///< [m/V]
  double curve_gap = NOT_A_NUMBER, curve_gap_std = NOT_A_NUMBER;      ///< [m] of SensorCalibration
  double volt = 0.0;                                                  ///< [V] at rest
};

/// Hits accepted at one height, and the sensor that recorded them.
struct HeightHits {
  std::vector<Hit> hits;
  SensorState sensor;
};

/// What the steps of one measurement share: the goal, what has been found so far, and the hits.
class Measurement {
 public:
  Measurement(const HammerParameters& parameters, const MachineModel& model, const MeasureFrfGoal& goal);

  int teeth() const { return goal.teeth > 0 ? goal.teeth : tool.teeth; }
  double leastPitch() const;  ///< [rad]
  /// [1] sense of a hit along the direction, in which the tool nears the sensor: 1 with the sensor opposite
  /// the hammer, else -1.
  double hitSense() const { return station.opposite ? 1.0 : -1.0; }
  /// Whether the sensor is below the hammer, which needs the flute's angle at the hammer.
  bool hasOffset() const { return station.offset > 0.0; }

  /// Whether spindle and tool modes are corrected to the tip apart from one another.
  bool correctsPerMode() const;
  bool needsSecondHeight() const;
  /// [m] by which the tool is lowered for the second height: no further than the flute search has been, and
  /// far enough from the tool's end that the hammer still meets it.
  double lowered() const;

  HeightHits& height() { return at_second_height ? second : first; }
  /// Hits to average at the present height. At the second one half as many: only the ratio matters.
  int hitsRequired() const;
  /// [1] share of the whole measurement that is done
  double hitProgress() const;

  /// [rad] rotation of the spindle, with a flute at the hammer, from a flute at the sensor of an axis
  double rotationFromFlute(std::size_t axis) const;
  /// [m] towards the sensor of an axis until the tool is as near to its face as permitted, for any lag of the
  /// helix between the model's and that of the flutes found.
  /// @param moved [m] towards the sensor since the station's position
  double safeTravel(std::size_t axis, double moved) const;

  void report(const std::string& stage, double progress);

  const HammerParameters& parameters;
  const HammerStation& station;
  const ToolGeometry& tool;
  const MeasureFrfGoal goal;
  const StationPaths paths;
  const bool turned;  // the station, about z

  MeasureFrfResult result;
  std::optional<Feedback> feedback;
  bool at_station = false;  // the tool is near the sensors
  bool at_second_height = false;
  std::string no_second_height;  // why there is none
  std::string no_cross;          // why there is no cross FRF

  SensorApproach approach;      // of the tool at the tip, as the first search measured it
  double flank_volt = 0.0;      // [V] of the first sensor at the station, a flute at the hammer
  std::optional<double> swing;  // [m] towards the sensor that a hit may cause
  bool cross_calibration_done = false;
  HeightHits first, second, cross;
  int bad_hits = 0;
};

}  // namespace smartmill::hammer
