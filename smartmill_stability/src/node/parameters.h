#pragma once

#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_stability/chart/chart.h"
#include "smartmill_stability/chatter/chatter_detector.h"
#include "smartmill_stability/control/milling_control.h"

namespace smartmill::stability {

/// Parameters of stability_node and of the program chart.
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
        "Parameters of stability_node (package smartmill_stability): stability chart, chatter detection and "
        "control.");
    table.atLaunch("model", model, "path of a smartmill-model/1 file with tool and spindle limits");
    chart.declare(table);
    table.section(
        "Limits of small and large vibrations for a force curve (material/force_curve): topic "
        "stability/bistable.");
    table.number("bistable_speeds", bistable_speeds, "1", Range::closed(0, 10000),
                 "number of evenly spaced speeds; 0 or 1: no such chart");
    table.text("force_curve", force_curve,
               "path of a smartmill-force-curve/1 file (force_law --curve) used instead of the topic "
               "material/force_curve; empty: the topic");
    table.section("Chatter detection.");
    chatter.declare(table);
    table.choice("chatter_signal", chatter_signal, {"force", "vibration", "sound"},
                 "force (force/compensated), vibration (daq/vibration) or sound (daq/sound); severity is in "
                 "the unit of "
                 "the signal");
    table.section("Control: overrides in the running cut (service cnc/set_overrides).");
    control.declare(table);
    table.section();
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "largest delay of an event that is still put into stamp order");
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without input after which a diagnostic is raised and a record ends");
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
