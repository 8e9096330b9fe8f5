#pragma once

#include <array>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::cnc {

/// Limits of the machine; every block is checked against them before anything is sent.
struct MotionLimits {
  std::array<std::array<double, 2>, 3> travel{};  ///< [m] lowest and highest machine position of x, y, z
  double max_feed = 0.0;
  double max_spindle_speed = 0.0;
  double max_dwell = 60.0;
  double max_jog = 0.1;
  double min_feed_override = 0.3, max_feed_override = 1.2;
  double min_spindle_override = 0.5, max_spindle_override = 1.2;

  /// Without travel, a parameter of the node.
  void declare(ParameterTable& table) {
    table.number("max_feed", max_feed, "m/s", Range::notNegative(), "largest feed; 0: from the model");
    table.number("max_spindle_speed", max_spindle_speed, "rad/s", Range::notNegative(),
                 "largest spindle speed; 0: from the model");
    table.number("max_dwell", max_dwell, "s", Range::positive(), "longest dwell (G4)");
    table.number("max_jog", max_jog, "m", Range::positive(), "longest jog");
    table.number("min_feed_override", min_feed_override, "1", Range::closed(0.01, 1.0),
                 "smallest accepted feed override");
    table.number("max_feed_override", max_feed_override, "1", Range::closed(1.0, 2.0),
                 "largest accepted feed override");
    table.number("min_spindle_override", min_spindle_override, "1", Range::closed(0.1, 1.0),
                 "smallest accepted spindle override");
    table.number("max_spindle_override", max_spindle_override, "1", Range::closed(1.0, 2.0),
                 "largest accepted spindle override");
  }
  /// @throws Error naming key and value.
  void validate() const;
};

}  // namespace smartmill::cnc
