#pragma once

#include <array>
#include <optional>
#include <string>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/sensor/sensor_measurement.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibrator.h"
#include "smartmill_kalman/sensor/tap_collector.h"
#include "smartmill_kalman/sensor/tap_file.h"

namespace smartmill::kalman {

/// Taps of a plate of three or six channels on the machine (Bachrathy and Stepan, section 2): a goal sets the
/// point, the taps of measure_frf there are recorded with all channels, and a fit identifies the transfer
/// matrix from all taps. Inputs in stamp order; no machine motion, no files.
class PlateCalibrator {
 public:
  explicit PlateCalibrator(const TapParameters& taps) : parameters_(taps) {}

  /// Steps point, fit (of taps()), forget.
  CalibrationResult handle(const CalibrationGoal& goal);
  /// Block of the plate.
  void handle(const SampleBlock& block);
  void handleHammer(const SampleBlock& block);
  /// Records hits along an axis until endTaps().
  void beginTaps(const std::string& direction);
  void endTaps(const SensorResult& result);
  void reset() { *this = PlateCalibrator(parameters_); }

  const TapRecords& taps() const { return records_; }

 private:
  TapParameters parameters_;
  std::optional<std::array<double, 3>> point_;  // [m] of the taps; empty: unknown
  std::string direction_;
  std::optional<TapCollector> collector_;
  std::vector<std::size_t> columns_;  // of the blocks' channels
  TapRecords records_;
};

}  // namespace smartmill::kalman
