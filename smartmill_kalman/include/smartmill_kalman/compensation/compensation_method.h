#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <memory>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_kalman/compensation/compensation_parameters.h"
#include "smartmill_kalman/tuning/memory_schedule.h"

namespace smartmill::kalman {

/// Receivers of force blocks; empty ones are not called. The compensated block follows the measured block of
/// the same samples.
struct ForceOutputs {
  std::function<void(const ForceBlock&)> measured, compensated;

  void publish(const ForceBlock& measured_block, const ForceBlock& compensated_block) const {
    if (measured) measured(measured_block);
    if (compensated) compensated(compensated_block);
  }
};

/// Model and noise of one axis of the force sensor.
struct SensorAxis {
  ModalModel model;        ///< measured over applied force [1]
  double noise_rms = 0.0;  ///< [N] of one sample, > 0
};

/// Counts since the start, and state at the last block, for diagnostics.
struct CompensationHealth {
  std::size_t gaps = 0;          ///< jumps of the sample index
  std::size_t not_finite = 0;    ///< samples that are NaN or infinite
  std::size_t clipped = 0;       ///< samples at the saturation limit
  std::size_t mode_updates = 0;  ///< accepted shifts of the sensor's modes
  double innovation_ratio = 0;   ///< [1] RMS innovation over its standard deviation by design; 1: consistent
  /// [1] largest lag-one autocorrelation of an axis' innovations; 0 for an exact model, above 0.3 the model
  /// misses part of the force or of the sensor
  double innovation_correlation = 0;
  std::array<double, 3> zero{{0, 0, 0}};  ///< [N] sensor mean without cutting (condition AIR or NONE)
  double speed = 0;                       ///< [rad/s] of the filters; 0: passing through
  double speed_std = 0;                   ///< [rad/s] of an estimated speed; 0: measured
  std::size_t estimated_blocks = 0;       ///< compensated with an estimated speed
};

/// A compensation method: estimates the applied force of the three axes while the spindle turns at a known
/// speed. A new method is a class of its own and one case in makeCompensationMethod().
class CompensationMethod {
 public:
  virtual ~CompensationMethod() = default;

  /// Sensor of an axis (0 x, 1 y, 2 z) from now on; the filters restart.
  virtual void setSensor(std::size_t axis, const SensorAxis& sensor) = 0;
  /// Model in use.
  virtual const ModalModel& sensor(std::size_t axis) const = 0;

  /// Process noise over the speed from now on; the filters restart. Methods without harmonics ignore it.
  virtual void setMemory(const MemorySchedule&) {}

  /// A cutting condition begins: the filters restart, and no result depends on data before it.
  virtual void beginCondition(const CuttingCondition& condition) = 0;
  /// Adapts the filters to the spindle. @param sample_rate [Hz] @return whether they start at rest
  virtual bool prepare(const SpindleAngle& spindle, double sample_rate) = 0;
  /// Compensates one block and publishes it, now or after later blocks. @param compensated holds the
  /// measured samples and the status to publish @param health speed, innovations and mode_updates are set
  virtual void process(const ForceBlock& measured, ForceBlock compensated, CompensationHealth& health) = 0;
  /// Speed that the filters use [rad/s].
  virtual double speed() const = 0;

  /// The filters forget their state; pending blocks are published.
  virtual void stop() = 0;
  /// Publishes pending blocks, estimated from the samples so far.
  virtual void flush() {}
  /// As new, without publishing; sensor models are kept.
  virtual void reset() = 0;
};

/// The method that the parameters select.
std::unique_ptr<CompensationMethod> makeCompensationMethod(const CompensationParameters& parameters,
                                                           ForceOutputs outputs);

}  // namespace smartmill::kalman
