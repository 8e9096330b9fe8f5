#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_kalman/compensation/force_compensation.h"
#include "smartmill_kalman/compensation/matrix_compensation.h"
#include "smartmill_kalman/sensor/plate_calibrator.h"
#include "smartmill_kalman/sensor/sensor_measurement.h"
#include "smartmill_kalman/sensor/spindle_force_sensor.h"
#include "smartmill_kalman/sensor/spindle_sensor_calibrator.h"

namespace smartmill::kalman {

/// Everything the kalman node thinks with, behind the sorter: takes inputs in any order of arrival,
/// compensates, and measures the sensor when a goal asks for it; modes it has measured serve from then on.
/// The node and the offline tool both feed this class, so that both give the same numbers.
class CompensationPipeline {
 public:
  /// Where results go; empty ones are not called.
  struct Outputs {
    ForceCompensation::Output force;
    std::function<void(const StrikeCommand&)> strike;
    std::function<void(const TapFeedback&)> feedback;
    std::function<void(const SensorResult&)> result;
    std::function<void(const CalibrationResult&)> calibration = {};
  };

  /// @param sensor the believed sensor: serves the axes not measured @param hold_back [s], see StreamSorter.
  /// @throws Error.
  CompensationPipeline(const CompensationParameters& parameters, const TapParameters& taps,
                       const ForceSensor& sensor, double hold_back, Outputs outputs);
  CompensationPipeline(const CompensationPipeline&) = delete;
  CompensationPipeline& operator=(const CompensationPipeline&) = delete;

  /// Blocks of six sensors in the spindle (channels x1 .. z2) become forces from now on; samples that are no
  /// measurement come out as NaN. @param length [m] of tool and holder. @throws Error.
  void useSpindleSensor(const SpindleSensorCalibration& calibration, double length);
  /// Length [m] of tool and holder for a calibration that is made here.
  void setSpindleSensorLength(double length) { spindle_length_ = length; }
  /// Six sensors without a calibration are not refused but wait for one.
  void awaitCalibration() { awaits_calibration_ = true; }
  bool uncalibrated() const { return awaits_calibration_ && !spindle_; }
  /// Blocks of a sensor of 3 or 6 channels go through the inverse of its matrix from now on, instead of the
  /// filters; they come out late. @throws Error.
  void useTransferMatrix(const TransferMatrix& matrix, double bandwidth);
  /// @return null without a transfer matrix.
  const MatrixCompensation* transferMatrix() const { return inverse_ ? &*inverse_ : nullptr; }
  /// The sensor's cross-talk serves from now on, its own axes instead of the believed ones until taps tell
  /// better.
  void useMatrix(const SensorMatrix& matrix) {
    matrix_ = matrix;
    useModelFile();
  }
  /// @return counts of the spindle's sensor; null without one.
  const SpindleSensorHealth* spindleHealth() const { return spindle_ ? &spindle_->health() : nullptr; }

  /// Block of the force sensor.
  void push(SampleBlock block);
  /// Block of the hammer; a machine without one never sends any.
  void pushHammer(SampleBlock block);
  void push(const SpindleAngle& angle);
  void push(const CuttingCondition& condition);
  /// @param begin told, when its time has come, whether the goal can be taken (false while another
  /// measurement runs); returns whether it is still wanted; may be empty
  void push(const MeasureFrfGoal& goal, std::function<bool(bool)> begin = {});
  /// A step of the calibration of a spindle's sensor, at its stamp. @param begin as of the goal above
  void push(const CalibrationGoal& goal, std::function<bool(bool)> begin = {});
  /// Ends a reading, at the stamp of the newest input.
  void cancelCalibration();
  const SpindleSensorCalibrator& calibrator() const { return calibrator_; }
  const PlateCalibrator& plate() const { return plate_; }
  /// Something that happened outside the streams, at the stamp of the newest input.
  void event(std::function<void(SensorMeasurement&)> what);
  /// Modes measured earlier (tool/modes of the force sensor) serve from their stamp on, unless the same or
  /// later taps have been seen here. Those of other points are ignored.
  void push(const MeasuredModes& modes);
  /// The hammer's stream has died: it holds the others back no longer.
  void hammerLost(const std::string& text);
  /// End of data.
  void flush() {
    sorter_.flush();
    compensation_.flush();
    if (inverse_) inverse_->flush();
  }

  const CompensationHealth& health() const { return compensation_.health(); }
  /// Model in use of an axis.
  const ModalModel& sensor(std::size_t axis) const { return compensation_.sensor(axis); }
  /// Age of the oldest modes in use that taps have told, at the newest input [s]; 0 when all are the model
  /// file's.
  double modesAge() const;
  bool measuring() const { return measurement_.active(); }
  std::string waitingFor() const { return sorter_.waitingFor(); }
  std::size_t late() const { return sorter_.late(); }
  /// Told when stamps jump back: a bag was restarted. Identified modes are forgotten then.
  void onRestart(std::function<void()> told) { restarted_ = std::move(told); }

 private:
  void drain();
  void drainCalibration();
  void serve(CalibrationResult result);
  SampleBlock toForces(const SampleBlock& block);
  void forward(const ForceBlock& measured, const ForceBlock& compensated);
  void useModelFile();

  ForceSensor believed_;
  Outputs outputs_;
  ForceCompensation compensation_;
  SensorMeasurement measurement_;
  StreamSorter sorter_;
  std::array<double, 3> identified_{};  // [s] stamp of the modes in use, an axis each
  StreamSorter::Stream conditions_, goals_, hammers_, angles_, blocks_;
  std::optional<MatrixCompensation> inverse_;
  std::optional<SpindleForceSensor> spindle_;
  bool awaits_calibration_ = false;
  double spindle_length_ = 0.0;  // [m] 0: not told
  std::optional<CuttingCondition> condition_;
  TapParameters taps_;
  SpindleSensorCalibrator calibrator_;
  PlateCalibrator plate_;
  double bandwidth_;  // [Hz] of a matrix that is made here
  std::optional<SensorMatrix> matrix_;
  std::deque<std::pair<std::uint64_t, std::uint64_t>> invalid_;  // samples [from, to) that are no measurement
  std::function<void()> restarted_;
};

}  // namespace smartmill::kalman
