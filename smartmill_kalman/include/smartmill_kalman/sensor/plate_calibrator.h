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

/// Taps of a plate of three or six channels on the machine (Bachrathy and Stepan, section 2): a goal tells
/// the point, the taps of measure_frf along an axis there are kept with all channels, and a fit makes the
/// matrix of all. Inputs in stamp order; nothing moves, and nothing is written.
class PlateCalibrator {
 public:
  explicit PlateCalibrator(const TapParameters& taps) : parameters_(taps) {}

  /// Steps point, fit (of taps()), forget.
  CalibrationResult handle(const CalibrationGoal& goal);
  /// Block of the plate.
  void handle(const SampleBlock& block);
  void handleHammer(const SampleBlock& block);
  /// Blows from now on are along an axis, for the measurement that tapped() ends.
  void beginTaps(const std::string& direction);
  void endTaps(const SensorResult& result);
  void reset() { *this = PlateCalibrator(parameters_); }

  const TapRecords& taps() const { return records_; }

 private:
  TapParameters parameters_;
  std::optional<std::array<double, 3>> point_;  // [m] of the taps; empty: not told
  std::string direction_;
  std::optional<TapCollector> collector_;
  std::vector<std::size_t> columns_;  // of the blocks' channels
  TapRecords records_;
};

}  // namespace smartmill::kalman
