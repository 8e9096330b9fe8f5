#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/pulse_tachometer.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_sim/world/world.h"

namespace smartmill::kalman {

/// The simulated machine with its sensors and the CompensationPipeline of one of them: the streams of the
/// nodes in one thread, without ROS.
class SpindleRig {
 public:
  /// @param options with pulse_train the spindle angle is that of its pulses @param use_plate the
  /// dynamometer's blocks are compensated; false: those of the sensor in the spindle
  SpindleRig(const MachineModel& model, const sim::WorldOptions& options,
             const CompensationParameters& filter, const TapParameters& taps, bool use_plate);

  CompensationPipeline& sorted() { return *sorted_; }
  sim::World& world() { return world_; }
  double now() const { return now_; }  ///< [s]

  /// Advances the machine. @param velocity [m/s] of the tool
  void run(double seconds, const std::array<double, 3>& velocity = {});
  void place(const std::array<double, 3>& position) { position_ = position; }
  void spin(double speed) { speed_ = speed; }  ///< [rad/s]
  void publishCondition(CuttingCondition::Kind kind, const Engagement& engagement = {});

  /// Weights as Burzoni hangs them (3.2), or the tool against the workpiece (3.2.1).
  void readStatic(const std::vector<double>& lengths, const std::vector<double>& loads, bool reference);
  /// Result of a calibration step. @throws Error without a result.
  CalibrationResult ask(const CalibrationGoal& goal);
  /// Result of the taps of kalman/measure_frf. @throws Error without a result.
  SensorResult tap(const std::string& direction, int hits);

  /// Measured, compensated and true forces from start() to take().
  struct Record {
    std::array<std::vector<double>, 3> truth, measured, compensated, dynamometer;
    std::array<std::vector<double>, 6> sensors;
    std::vector<double> hammer;  ///< [N]
    std::vector<double> angle;   ///< [rad] of tooth 1
  };
  int slots();  ///< number of slots so far
  void start();
  /// Ends the record.
  Record take();

 private:
  void hear(const sim::World::Block& block);

  MachineModel model_;
  sim::World world_;
  bool use_plate_;
  std::unique_ptr<CompensationPipeline> sorted_;
  std::optional<PulseTachometer> tachometer_;  // with pulse_train
  std::array<double, 3> position_{{0, 0, 0}};
  double speed_ = 0.0, angle_ = 0.0, now_ = 0.0;
  int tests_ = 0, slots_ = 0;
  std::optional<CalibrationResult> calibration_;
  std::optional<SensorResult> tapped_;
  bool recording_ = false;
  double from_ = 0.0;  // [s] of the record
  Record record_;
};

/// A straight pass along x at a y [m], at constant speed; the record contains complete blocks from full
/// engagement on.
/// @param speed [rad/s] @param air [s] before the cut @param through the tool cuts to the end of the stock
SpindleRig::Record cutAlong(SpindleRig& rig, const MachineModel& model, double y,
                            const Engagement& engagement, double speed, double air, double seconds,
                            bool through);

/// A straight slot through the stock of the model along x, at constant speed; the record contains complete
/// blocks from full engagement on. @param speed [rad/s] @param depth [m] @param feed [m] per tooth @param air
/// [s] before the cut
SpindleRig::Record cutSlot(SpindleRig& rig, const MachineModel& model, double speed, double depth,
                           double feed, double air, double seconds);

}  // namespace smartmill::kalman
