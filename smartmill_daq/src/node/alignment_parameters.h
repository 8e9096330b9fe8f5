#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_daq/alignment/stream_alignment.h"

namespace smartmill::daq {

/// Parameters of alignment_node.
struct AlignmentNodeParameters {
  std::string late, early;
  AlignmentOptions alignment;
  double input_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of alignment_node (package smartmill_daq): shift between the streams of two devices.");
    table.atLaunch("late", late,
                   "signal of the device whose latency is sought, TOPIC/CHANNEL of sample blocks");
    table.atLaunch("early", early, "signal that it is compared with, TOPIC/CHANNEL or cnc/state/AXIS");
    table.number("window", alignment.window, "s", Range::closed(1.0, 600.0),
                 "time that is evaluated at once; longer than range");
    table.number("range", alignment.range, "s", Range::positive(), "searched to either side");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without samples after which diagnostics report a dead input");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    if (late.empty() || early.empty()) throw Error("late, early: expected two signals TOPIC/CHANNEL");
    if (!(alignment.range < alignment.window)) throw Error("range: expected less than window");
  }
};

}  // namespace smartmill::daq
