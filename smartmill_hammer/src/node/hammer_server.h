#pragma once

#include <map>
#include <optional>
#include <string>

#include <ros/node_handle.h>

#include "machine_commands.h"
#include "parameters.h"
#include "smartmill_hammer/sequence/sorted_sequence.h"
#include "smartmill_ros/frf_server.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill {
namespace hammer {

/// Shell around SortedSequence: goals and streams in, commands to the CNC bridge's actions and to daq/strike,
/// results out. All callbacks run in one thread.
class HammerServer {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on bad parameters or a bad model file.
  HammerServer(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  void finish(const MeasureFrfResult& result);
  void watch();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  NodeShell shell_;
  std::optional<MachineCommands> machine_;  // none in a replay
  SortedSequence sorted_;
  FrfServer server_;
  std::map<std::string, MeasuredModes> last_good_;  // by tool and direction
  std::string drift_;  // of the newest measurement against the one before; empty: none
};

}  // namespace hammer
}  // namespace smartmill
