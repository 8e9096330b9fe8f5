#pragma once

#include <array>
#include <memory>
#include <vector>

#include "smartmill_sim/world/world.h"

namespace smartmill::sim {

/// One sensor of the world (or a true value): it fills its channels of a block. makeSensors() lists all.
class WorldSensor {
 public:
  /// One integration step.
  struct Step {
    const CuttingMachine::Input& input;
    const CuttingMachine::Output& output;
    const HammerStation::Push& push;  ///< of the hammer station
    const ManualForces::Forces& manual;
    double height;  ///< [m] z of the tip
  };
  /// One sample: means over its steps.
  struct Sample {
    double time;                  ///< [s]
    const MotionState& motion;    ///< half a sample later
    double share;                 ///< [1] of one step in the sample
    std::array<double, 3> force;  ///< [N] cutting force on the tool
    double torque;                ///< [N m] of the cut
    double load_meter;            ///< [V] at the end of the sample
  };

  virtual ~WorldSensor() = default;
  /// Begins a block, with stamp and index of its first sample.
  virtual void begin(double /*stamp*/, std::uint64_t /*first_index*/, World::Block& /*block*/) {}
  virtual void step(const Step& /*step*/) {}
  virtual void read(const Sample& sample, World::Block& block) = 0;
  /// The block is complete.
  virtual void end(World::Block& /*block*/) {}
};

/// What the sensors of a world are made from; it outlives them.
struct SensorContext {
  const MachineModel& model;
  const WorldOptions& options;
  double step;             ///< [s] of integration
  HammerStation* station;  ///< nullptr: none
  SpindleSensor* flange;   ///< nullptr: none
  ServoRecorder& servo;
  const ManualForces& manual;
  WorldRandom& random;
};
/// All sensors of a world, in the order in which they draw random numbers.
std::vector<std::unique_ptr<WorldSensor>> makeSensors(const SensorContext& context);

}  // namespace smartmill::sim
