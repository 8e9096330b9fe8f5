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
/// matrix from all taps. Taps at a reference point are not fitted: verify compares their force with that of
/// the matrix in use. Inputs in stamp order; no machine motion, no files.
class PlateCalibrator {
 public:
  /// @param bandwidth [Hz] of the matrices that are fitted here
  PlateCalibrator(const TapParameters& taps, double bandwidth) : parameters_(taps), bandwidth_(bandwidth) {}

  /// Steps point, fit (of taps()), verify, forget.
  CalibrationResult handle(const CalibrationGoal& goal);
  /// Block of the plate.
  void handle(const SampleBlock& block);
  void handleHammer(const SampleBlock& block);
  /// Records hits along an axis until endTaps().
  void beginTaps(const std::string& direction);
  void endTaps(const SensorResult& result);
  /// Deletes the taps.
  void reset();
  /// The matrix in use, inverted up to a bandwidth [Hz].
  void use(const TransferMatrix& matrix, double bandwidth);
  /// Constants of the matrix in use: forces at low frequency over the readings, and the error expected up to
  /// the bandwidth from the standard deviations of its elements.
  CalibrationResult describe() const;

  const TapRecords& taps() const { return records_; }

 private:
  CalibrationResult fit() const;
  CalibrationResult verify() const;

  TapParameters parameters_;
  std::optional<std::array<double, 3>> point_;  // [m] of the taps; empty: unknown
  std::string direction_;
  std::optional<TapCollector> collector_;
  std::vector<std::size_t> columns_;  // of the blocks' channels
  bool reference_point_ = false;
  TapRecords records_, reference_;
  std::optional<TransferMatrix> matrix_;  // in use
  double bandwidth_ = 0.0;                // [Hz]
};

}  // namespace smartmill::kalman
