#pragma once

#include <optional>

#include <ros/node_handle.h>

#include "machine_commands.h"
#include "parameters.h"
#include "smartmill_hammer/analysis/health_watch.h"
#include "smartmill_hammer/analysis/idle_spindle.h"
#include "smartmill_hammer/sequence/hammer_pipeline.h"
#include "smartmill_ros/frf_server.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::hammer {

/// Inputs of the measurement and of the air cuts, which share the spindle angle.
struct Streams {
  HammerPipeline& sequence;
  IdleSpindlePipeline& idle;

  void push(const SampleBlock& hammer) { sequence.push(hammer); }
  void push(const CncState& state) { sequence.push(state); }
  void push(const SpindleAngle& angle) {
    sequence.push(angle);
    idle.push(angle);
  }
};

/// ROS interface of HammerPipeline: goals and streams in, commands to the actions of the CNC bridge and to
/// daq/strike, results out. All callbacks run in one thread.
class HammerServer {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on bad parameters or a bad model file.
  HammerServer(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void finish(const MeasureFrfResult& result);
  void publish(const std::optional<HealthReport>& report);
  void checkInputs();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  NodeShell shell_;
  std::optional<MachineCommands> machine_;  // none in a replay
  HammerPipeline pipeline_;
  IdleSpindlePipeline idle_;
  Streams streams_;
  FrfServer server_;
  HealthWatch health_;
  ros::Publisher health_publisher_;
};

}  // namespace smartmill::hammer
