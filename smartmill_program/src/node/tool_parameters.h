#pragma once

#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_program/tool/tool_monitor.h"

namespace smartmill::program {

/// Parameters of tool_node.
struct ToolNodeParameters {
  std::string model;
  std::string force = "compensated";
  ToolMonitorParameters monitor;
  bool hold_on_breakage = false;
  double hold_back = 0.05;
  double input_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of tool_node (package smartmill_program): loss of a tooth and wear by the forces of the "
        "teeth.");
    table.atLaunch(
        "model", model,
        "path of a smartmill-model/1 file with the tool, and the coefficients of the sharp tool if "
        "they are known; N=FILE for tool N of several, separated by blanks");
    table.choice("force", force, {"compensated", "dynamometer"},
                 "compensated (force/compensated) or dynamometer (daq/dynamometer, force on the tool)");
    monitor.declare(table);
    table.flag(
        "hold_on_breakage", hold_on_breakage,
        "true: a lost tooth requests a feed hold (service cnc/feed_hold), which the bridge grants only "
        "while motion is armed and the controller supports it");
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "largest delay of an event that is still put into stamp order");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without input after which diagnostics report a dead input");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    monitor.validate();
  }
};

}  // namespace smartmill::program
