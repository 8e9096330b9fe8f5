#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/compensation/compensation_method.h"
#include "smartmill_kalman/compensation/force_model_chooser.h"
#include "smartmill_kalman/compensation/steady_speed.h"
#include "smartmill_kalman/filter/coupled_filter.h"

namespace smartmill::kalman {

/// Sensor blocks in, force blocks out with the same sample index. Checks the samples, passes them through
/// while the spindle is slow or its speed changes, and otherwise hands them to a CompensationMethod, with the
/// measured or an estimated speed (ForceModelChooser). Inputs
/// come in stamp order (CompensationPipeline), and the result depends only on them: the filters restart at
/// every cutting condition and at a gap of the sample index.
class ForceCompensation {
 public:
  /// @param measures_workpiece the sensor measures the reaction: samples are negated. @throws Error.
  ForceCompensation(const CompensationParameters& parameters, bool measures_workpiece, ForceOutputs outputs);

  /// Model of an axis (0 x, 1 y, 2 z) from now on; the filters restart.
  void setSensor(std::size_t axis, const ModalModel& sensor) {
    setSensor(axis, sensor, parameters_.filter.noise_rms);
  }
  /// @param noise_rms [N] of one sample, > 0
  void setSensor(std::size_t axis, const ModalModel& sensor, double noise_rms);
  /// Sensor with cross-talk from now on (CoupledCompensation). Its diagonal elements are the sensor models;
  /// setSensor() replaces them, the cross-talk stays. @throws Error.
  void setMatrix(const SensorMatrix& matrix);
  /// Whether the sensor differs from an ideal one in any axis, as far as known; else forces pass through.
  bool hasDynamics() const;
  /// Process noise over the spindle speed from now on; the filters restart.
  void setMemory(const MemorySchedule& memory);
  const MemorySchedule& memory() const { return memory_; }
  /// Model in use.
  const ModalModel& sensor(std::size_t axis) const { return method_->sensor(axis); }

  /// @throws Error when channel fx, fy or fz is missing or not in N.
  static void check(const SampleBlock& block);
  /// @throws Error as check(), or when the filters cannot be designed.
  void handle(const SampleBlock& block);
  void handle(const SpindleAngle& angle);
  void handle(const CuttingCondition& condition);
  void handle(const CncState& state);

  /// End of data: pending blocks are published.
  void flush() { method_->flush(); }
  /// A recording was restarted: as new, sensor models are kept.
  void reset();

  const CompensationHealth& health() const { return health_; }
  /// Force model in use and its reason, one line.
  std::string forceModel() const { return chooser_.text(); }
  bool hasDefaultForceModel() const { return chooser_.hasDefault(); }

 private:
  ForceBlock measuredForce(const SampleBlock& block);
  void updateZero(const ForceBlock& measured);
  void makeMethod();
  /// Takes the speed of a block. @return whether it is known and steady
  bool takeSpeed(double stamp);

  CompensationParameters parameters_;
  double sign_;
  ForceOutputs outputs_;
  ForceModelChooser chooser_;
  bool estimates_speed_;  // the method
  std::unique_ptr<CompensationMethod> method_;
  MemorySchedule memory_;
  std::optional<SensorMatrix> matrix_;
  std::array<std::optional<SensorAxis>, 3> sensor_;
  SteadySpeed steady_speed_;
  SpindleAngle angle_;    // newest reading
  SpindleAngle spindle_;  // that the method uses
  std::optional<CuttingCondition> condition_;
  std::optional<std::uint64_t> next_index_;
  double settling_left_ = 0.0;  // [s]
  CompensationHealth health_;
};

}  // namespace smartmill::kalman
