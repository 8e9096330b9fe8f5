#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/sensor/sensor_measurement.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibration.h"
#include "smartmill_kalman/sensor/tap_collector.h"
#include "smartmill_kalman/sensor/transfer_matrix.h"

namespace smartmill::kalman {

/// A step of a calibration, requested by the operator.
struct CalibrationGoal {
  enum class Step : std::uint8_t { measurement = 0, fit = 1, verify = 2, forget = 3, point = 4 };
  double stamp = 0.0;  ///< [s] earlier sensor data are not used
  Step step = Step::measurement;
  int test = 0;                           ///< measurements of one test have a common drift
  double length = 0.0;                    ///< [m] of tool and holder
  std::array<double, 3> load{{0, 0, 0}};  ///< [N] on the tool; with step point: position of the taps [m]
  bool reference = false;                 ///< measurement or taps are used by verify, not by fit
  double duration = 0.5;                  ///< [s] averaging time of a measurement
  std::string file;                       ///< of fit: calibration file; its measurements go to `file`.csv
};

struct CalibrationResult {
  enum class Code : std::uint8_t { ok = 0, cancelled = 1, bad_goal = 2, bad_data = 3, fit_failed = 4 };
  Code code = Code::ok;
  std::string message;       ///< one line
  std::size_t readings = 0;  ///< number of measurements, of the goal's kind
  /// [1] relative to the force along x, y, z: of verify the largest difference from the reference, of fit
  /// that expected from the standard deviations; NaN: unknown
  std::array<double, 3> error{{NOT_A_NUMBER, NOT_A_NUMBER, NOT_A_NUMBER}};
  bool verified = false;  ///< error is that of verify
  /// [1] of fit: force over the reading of x, y, z and its standard deviation; NaN: unknown
  std::array<double, 3> constant = error, constant_std = error;
  /// Of fit: in use from now on.
  std::optional<SpindleSensorCalibration> calibration;
  std::optional<TransferMatrix> matrix;  ///< of a plate, likewise
  std::optional<MemorySchedule> memory;  ///< process noise over the spindle speed, likewise
};

/// Calibration of the sensor in use.
struct SensorCalibrationState {
  bool calibrated = true;    ///< false: no force is published
  std::string message;       ///< one line: result, or why it is not calibrated
  double stamp = 0.0;        ///< [s]
  std::size_t readings = 0;  ///< 0: from a file or the machine model
  std::array<double, 3> constant = CalibrationResult().constant, constant_std = constant, error = constant;
  bool verified = false;  ///< error is the difference from a reference
};

/// Calibrates a spindle-integrated sensor on the machine (Burzoni 3.2, 3.4): measurements under known loads
/// give the constants over tool length and the static cross-talk, the taps of measure_frf the dynamic
/// cross-talk. Inputs in stamp order; no machine motion, no files.
class SpindleSensorCalibrator {
 public:
  /// @param taps detection of hits @param base preload and limits
  SpindleSensorCalibrator(const TapParameters& taps, const SpindleSensorCalibration& base);

  /// @return false while a measurement runs; the goal is ignored.
  bool handle(const CalibrationGoal& goal);
  /// Block of the six sensors. @throws Error when a channel is missing.
  void handle(const SampleBlock& block);
  void handleHammer(const SampleBlock& block);
  /// Records hits along an axis until endTaps(). @param length [m] of tool and holder; 0: unchanged
  void beginTaps(const std::string& direction, double length = 0.0);
  void endTaps(const SensorResult& result);
  void cancel();
  void reset();
  /// Constants at a length [m] of tool and holder with their standard deviations.
  static CalibrationResult describe(const SpindleSensorCalibration& calibration, double length);

  bool active() const { return goal_.has_value(); }
  /// Calibration in use, of the last fit or as constructed.
  const SpindleSensorCalibration& base() const { return base_; }
  void setMemory(const MemorySchedule& memory) { base_.memory = memory; }
  bool hasMeasurements() const { return measurements_.size() > 0; }
  std::optional<CalibrationResult> takeResult();
  /// Measurements of fit as a table for `spindle_sensor calibrate`.
  std::string measurementTable() const;

 private:
  void addSamples(const SampleBlock& block, const std::array<std::size_t, 6>& column);
  void finish(CalibrationResult::Code code, const std::string& message);
  void fit();
  std::string fitDynamicCrossTalks(SpindleSensorCalibration& calibration) const;
  void verify();

  TapParameters parameters_;
  SpindleSensorCalibration base_;
  StaticMeasurements measurements_, reference_;
  std::optional<CalibrationGoal> goal_;  // of the running measurement
  std::array<double, 6> sum_{};
  double time_sum_ = 0.0;
  std::size_t count_ = 0;
  std::optional<std::uint64_t> next_index_;

  std::string direction_;   // of the hits; empty: none
  TapCollector collector_;  // pairs' means of x, y, z
  /// By direction: pairs' means of each accepted hit, x, y, z.
  std::array<std::vector<std::array<std::vector<double>, 3>>, 3> taps_;
  double tap_rate_ = 0.0;    // [Hz]
  double tap_length_ = 0.0;  // [m] of tool and holder at the taps
  std::optional<CalibrationResult> result_;
};

}  // namespace smartmill::kalman
