#pragma once

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_sim/turning/lathe.h"

namespace smartmill::sim {

/// Parameters of lathe_node.
struct LatheParameters {
  LatheTraits lathe;
  double block = 5.0e-3;
  bool await_commands = false;

  // Set by programs only.
  double poll_period = 1e-3;  ///< [s] of waiting for commands: a fifth of a block

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of lathe_node (package smartmill_sim): the simulated lathe with a fast tool servo. SI "
        "units throughout.");
    lathe.declare(table);
    table.section();
    table.number("block", block, "s", Range::closed(1e-4, 0.1), "duration of a published block");
    table.flag("await_commands", await_commands,
               "the simulation waits for the commands of the next samples (for a loaded computer); a real "
               "lathe does not wait");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    lathe.validate();
  }
};

}  // namespace smartmill::sim
