#pragma once

#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill::hammer {

/// Parameters of hammer_node, and of `frf` for a bag.
struct NodeParameters {
  std::string model;
  bool command_machine = true;
  HammerParameters measurement;
  double hold_back = 0.05;
  double stale_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of hammer_node (package smartmill_hammer) and of rosrun smartmill_hammer frf --params: "
        "automatic hammer. SI units throughout.");
    table.atLaunch("model", model, "path of a smartmill-model/1 file with tool and hammer");
    table.atLaunch("command_machine", command_machine,
                   "false: replay; no commands are sent, the recorded streams answer them");
    measurement.declare(table);
    table.section("Streams.");
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "longest delay of a goal after its stamp");
    table.number("stale_timeout", stale_timeout, "s", Range::positive(),
                 "wall time without a message of a sensor that ends the measurement");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    measurement.validate();
  }
};

}  // namespace smartmill::hammer
