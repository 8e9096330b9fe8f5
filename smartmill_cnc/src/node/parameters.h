#pragma once

#include <array>
#include <string>
#include <vector>

#include "smartmill_cnc/bridge.h"
#include "smartmill_cnc/linuxcnc/linuxcnc_controller.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc {

/// Parameters of cnc_node.
struct NodeParameters {
  std::string kind = "fanuc";
  FocasParameters controller;
  linuxcnc::LinuxCncParameters linuxcnc;
  std::string load_input;
  double load_timeout = 0.1;
  double rate = 50.0;
  double reconnect_period = 1.0;
  MotionParameters motion;
  std::string motion_nodes = "hammer stability discover";
  std::string motion_log = "auto";
  std::string model;
  std::array<std::vector<double>, 3> travel;

  // Set by programs only.
  int feedback_every = 5;     ///< [polls] between two messages of feedback: ten a second
  double longest_call = 4.0;  ///< [s] of a service in the bridge's thread, which waits for the controller

  void declare(ParameterTable& table);
  /// Checks the file alone. @throws Error naming key and value.
  void validate() const;
  /// @return a copy with missing limits from the machine model. @throws Error naming key and value, also of a
  /// limit that neither states.
  NodeParameters completed() const;
  /// Full names of motion_nodes.
  std::vector<std::string> helpers() const;
  /// File of motion_log; empty: none. @throws Error when no data folder is defined.
  std::string motionLogFile() const;
};

}  // namespace smartmill::cnc
