#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_core/signal/pulse_tachometer.h"

namespace smartmill::cnc {

/// Parameters of tachometer_node.
struct TachometerNodeParameters {
  std::string input = names::TACHOMETER;
  PulseTachometerParameters tachometer;
  double input_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of tachometer_node (package smartmill_cnc): spindle/angle from a tachometer with one or "
        "more pulses per revolution.");
    table.text("input", input, "topic (SampleBlock) with a channel tachometer [V]");
    tachometer.declare(table);
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without samples after which diagnostics report a dead input");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    if (input.empty()) throw Error("input: empty, expected a topic");
  }
};

}  // namespace smartmill::cnc
