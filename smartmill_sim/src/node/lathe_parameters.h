#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_sim/turning/lathe.h"
#include "smartmill_sim/turning/turning_machine.h"

namespace smartmill::sim {

/// Parameters of lathe_node.
struct LatheParameters {
  std::string model;
  LatheTraits lathe;
  TurningTraits turning;
  double block = 5.0e-3;
  bool await_commands = false;
  double pace = 1.0;

  // Set by programs only.
  double poll_period = 1e-3;   ///< [s] of waiting for commands: a fifth of a block
  double state_period = 2e-2;  ///< [s] of cnc/state and cnc/load: the rate of the bridge to a controller

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of lathe_node (package smartmill_sim): the simulated lathe with a fast tool servo. SI "
        "units throughout.");
    table.atLaunch("model", model,
                   "path of a smartmill-model/1 file with a spindle; required with motor_currents");
    table.section();
    lathe.declare(table);
    turning.declare(table);
    table.section();
    table.number("block", block, "s", Range::closed(1e-4, 0.1), "duration of a published block");
    table.flag("await_commands", await_commands,
               "the simulation waits for the commands of the next samples (for a loaded computer); a real "
               "lathe does not wait");
    table.number("pace", pace, "1", Range::closed(0.01, 100.0),
                 "simulated time per wall time with /use_sim_time, at most: a slow computer takes longer");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    lathe.validate();
    turning.validate();
    if (turning.motor.currents && model.empty())
      throw Error("model: empty, expected the path of a smartmill-model/1 file with motor_currents");
  }
};

}  // namespace smartmill::sim
