#pragma once

#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_stability/chart/chart.h"
#include "smartmill_stability/chatter/chatter_detector.h"
#include "smartmill_stability/control/milling_control.h"

namespace smartmill::stability {

/// Parameters of stability_node and of `chart` on a bag.
struct NodeParameters {
  std::string model;
  ChartParameters chart;
  int bistable_speeds = 40;
  std::string force_curve;
  ChatterParameters chatter;
  std::string chatter_signal = "force";
  MillingControlParameters control;
  double hold_back = 0.05;
  double input_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of stability_node (package smartmill_stability): the stability chart, chatter in the "
        "cut.");
    table.atLaunch("model", model,
                   "path of a smartmill-model/1 file; it gives the tool and the spindle's limits");
    chart.declare(table);
    table.section("Small and large vibrations by a force curve (material/force_curve): stability/bistable.");
    table.number("bistable_speeds", bistable_speeds, "1", Range::closed(0, 10000),
                 "evenly from low to high; 0 or 1: none is made");
    table.text(
        "force_curve", force_curve,
        "path of a smartmill-force-curve/1 file (force_law --curve) in the place of material/force_curve; "
        "empty: the topic");
    table.section("Chatter in the running cut.");
    chatter.declare(table);
    table.choice(
        "chatter_signal", chatter_signal, {"force", "vibration", "sound"},
        "force (force/compensated), vibration (daq/vibration) or sound (daq/sound); severity has the "
        "signal's unit");
    table.section("What is done about it: overrides of the running cut (service cnc/set_overrides).");
    control.declare(table);
    table.section();
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "how late an event may arrive and still be in order");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "of silence that raises a diagnostic and ends a record");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    chart.validate();
    chatter.validate();
    control.validate();
  }
};

}  // namespace smartmill::stability
