#pragma once

#include <string>

#include "smartmill_cnc/angle/angle_sources.h"
#include "smartmill_core/names.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc {

/// Parameters of angle_node.
struct AngleNodeParameters {
  std::string encoder_input = names::daq("encoder");
  std::string pulses_input = names::TACHOMETER;
  std::string controller_input = "cnc/spindle_angle";
  std::string force_input = names::DYNAMOMETER;
  AngleSourcesParameters sources;
  double input_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of angle_node (package smartmill_cnc): spindle/angle from the best source that works, in "
        "this order.");
    table.text("encoder_input", encoder_input,
               "topic (SampleBlock) with a channel encoder [1], counts; empty: none");
    table.text("pulses_input", pulses_input,
               "topic (SampleBlock) with a channel tachometer [V]; empty: none");
    table.text("controller_input", controller_input, "topic (SpindleAngle) of the controller; empty: none");
    table.text("force_input", force_input,
               "topic (SampleBlock) of a cutting force, for order tracking; empty: none");
    sources.declare(table);
    table.section("Diagnostics.");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without samples after which diagnostics report a dead input");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

}  // namespace smartmill::cnc
