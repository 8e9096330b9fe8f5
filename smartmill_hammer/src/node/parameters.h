#pragma once

#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {
namespace hammer {

/// Parameters of hammer_node and of `frf` on a bag.
struct NodeParameters {
  std::string model;
  bool command_machine = true;
  HammerParameters measurement;
  double hold_back = 0.05;
  double stale_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of hammer_node (package smartmill_hammer) and of rosrun smartmill_hammer frf --params: "
        "the "
        "automatic hammer. SI units throughout.");
    table.atLaunch("model", model, "path of a smartmill-model/1 file with tool and hammer");
    table.atLaunch("command_machine", command_machine,
                   "false: replay; commands go nowhere, the recorded streams answer them");
    measurement.declare(table);
    table.section("Streams.");
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "a goal may arrive this long after its stamp and still be in order");
    table.number("stale_timeout", stale_timeout, "s", Range::positive(),
                 "of wall time without a message of a sensor: the measurement ends");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    measurement.validate();
  }
};

}  // namespace hammer
}  // namespace smartmill
