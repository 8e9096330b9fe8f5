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

/// A step of a calibration, as the operator asks for it.
struct CalibrationGoal {
  enum class Step : std::uint8_t { reading = 0, fit = 1, verify = 2, forget = 3, point = 4 };
  double stamp = 0.0;  ///< [s] sensor data before it are not used
  Step step = Step::reading;
  int test = 0;                           ///< readings of one test drift together
  double length = 0.0;                    ///< [m] of tool and holder
  std::array<double, 3> load{{0, 0, 0}};  ///< [N] that acts on the tool now; of point: [m] of the taps
  bool reference = false;                 ///< the reading serves verify, not fit
  double duration = 0.5;                  ///< [s] that a reading is the mean of
  std::string file;                       ///< of fit: where the calibration goes, its readings beside it
};

struct CalibrationResult {
  enum class Code : std::uint8_t { ok = 0, cancelled = 1, bad_goal = 2, bad_data = 3, fit_failed = 4 };
  Code code = Code::ok;
  std::string message;                     ///< one line
  std::size_t readings = 0;                ///< kept so far, of the goal's kind
  std::array<double, 3> error{{0, 0, 0}};  ///< [1] of verify, x, y, z
  /// Of fit: serves from now on.
  std::optional<SpindleSensorCalibration> calibration;
  std::optional<TransferMatrix> matrix;  ///< of a plate, likewise
};

/// Calibrates a spindle-integrated sensor on the machine (Burzoni 3.2, 3.4): readings under known loads give
/// the constants over tool length and the static cross-talk, the taps of measure_frf its course over
/// frequency. Inputs in stamp order; nothing moves, and nothing is written.
class SpindleSensorCalibrator {
 public:
  /// @param taps how blows are cut out @param base gives what readings do not tell
  SpindleSensorCalibrator(const TapParameters& taps, const SpindleSensorCalibration& base);

  /// @return false while a reading runs: the goal is refused and nothing changes.
  bool handle(const CalibrationGoal& goal);
  /// Block of the six sensors. @throws Error when a channel is missing.
  void handle(const SampleBlock& block);
  void handleHammer(const SampleBlock& block);
  /// Blows from now on are along an axis, for the measurement that tapped() ends. @param length [m] of tool
  /// and holder; 0: not told
  void beginTaps(const std::string& direction, double length = 0.0);
  void endTaps(const SensorResult& result);
  void cancel();
  void reset();

  bool active() const { return goal_.has_value(); }
  std::optional<CalibrationResult> takeResult();
  /// What fit reads, as a table of `spindle_sensor calibrate`.
  std::string measurementTable() const;

 private:
  void read(const SampleBlock& block, const std::array<std::size_t, 6>& column);
  void finish(CalibrationResult::Code code, const std::string& message);
  void fit();
  std::string fitDynamicCrossTalks(SpindleSensorCalibration& calibration) const;
  void verify();

  TapParameters parameters_;
  SpindleSensorCalibration base_;
  StaticMeasurements readings_, reference_;
  std::optional<CalibrationGoal> goal_;  // of the reading that runs
  std::array<double, 6> sum_{};
  double time_sum_ = 0.0;
  std::size_t count_ = 0;
  std::optional<std::uint64_t> next_index_;

  std::string direction_;   // of the blows; empty: none
  TapCollector collector_;  // pairs' means of x, y, z
  /// By direction: pairs' means after every blow that counts, x, y, z.
  std::array<std::vector<std::array<std::vector<double>, 3>>, 3> taps_;
  double tap_rate_ = 0.0;    // [Hz]
  double tap_length_ = 0.0;  // [m] of tool and holder at the taps
  std::optional<CalibrationResult> result_;
};

}  // namespace smartmill::kalman
