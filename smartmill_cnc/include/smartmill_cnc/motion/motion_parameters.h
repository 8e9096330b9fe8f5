#pragma once

#include "smartmill_cnc/motion/motion_limits.h"
#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc {

struct MotionParameters {
  bool read_only = true;
  double condition_lead = 0.3;
  double settle_time = 0.1;
  double standstill_speed = 0.2;
  double stall_timeout = 60.0;
  double stop_timeout = 5.0;
  double open_timeout = 3.0;
  MotionLimits limits;

  // Set by programs only.
  double longest_step = 5.0;  ///< [s] between two polls; a longer time is no delay but a set clock

  /// Without the limits, which have their own declare().
  void declare(ParameterTable& table) {
    table.flag("read_only", read_only, "true: motion cannot be armed, nothing is written to the controller");
    table.number("condition_lead", condition_lead, "s", Range::closed(0.0, 10.0),
                 "time by which a cutting condition is announced before it begins or ends");
    table.number("settle_time", settle_time, "s", Range::positive(),
                 "standstill after which a motion has ended");
    table.number("standstill_speed", standstill_speed, "rad/s", Range::positive(),
                 "spindle speed below which the spindle counts as stopped");
    table.number("stall_timeout", stall_timeout, "s", Range::positive(),
                 "time without progress after which a motion is cancelled, except in feed hold");
    table.number("stop_timeout", stop_timeout, "s", Range::positive(),
                 "longest time for a cancelled motion to stop");
    table.number("open_timeout", open_timeout, "s", Range::positive(),
                 "longest time in which the controller may refuse a program after a cancelled one");
  }

  /// @throws Error naming key and value.
  void validate() const;
};

}  // namespace smartmill::cnc
