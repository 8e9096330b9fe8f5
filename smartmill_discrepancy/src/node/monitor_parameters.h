#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_discrepancy/live/live_gap.h"
#include "smartmill_discrepancy/live/segment_recorder.h"

namespace smartmill::discrepancy {

/// Parameters of the monitor and of `explain` on a bag.
struct MonitorParameters {
  std::string model;
  std::string forces = "measured";
  SegmentParameters segment;
  double hold_back = 0.05;
  LiveGapOptions gap;
  std::string record_folder;
  double record_after = 0.4;
  bool record_all = false;
  int most_recorded = 40;
  int most_per_condition = 2;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of the monitor (package smartmill_discrepancy): the twin of the running machine.");
    table.atLaunch("model", model, "path of a smartmill-model/1 file: the model of the machine");
    table.choice(
        "forces", forces, {"measured", "compensated"},
        "measured: daq/dynamometer, the twin has the modes of the sensor; compensated: "
        "force/compensated of any force sensor, the twin's force on the tool (set by the launch file for "
        "sensor spindle and plate)");
    table.section();
    segment.declare(table);
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "maximum delay of a condition after its stamp");
    gap.declare(table);
    table.text(
        "record_folder", record_folder,
        "folder of the campaign for explain with the segments that do not fit; empty: none is recorded");
    table.number(
        "record_after", record_after, "s", Range::notNegative(),
        "minimum cutting time before a recorded segment: vibrations of the entry decay slowly in light cuts");
    table.flag("record_all", record_all, "record segments that fit too");
    table.number("most_recorded", most_recorded, "1", Range::notNegative(),
                 "maximum number of recorded segments");
    table.number("most_per_condition", most_per_condition, "1", Range::notNegative(),
                 "maximum number of recorded segments per cutting condition");
  }
  ComparedForce compared() const {
    return forces == "compensated" ? ComparedForce::compensated : ComparedForce::measured;
  }
  LiveGapOptions gapOptions() const {
    LiveGapOptions options = gap;
    options.compared = compared();
    return options;
  }
  void validate() const { checkBounds(*this); }  ///< @throws Error naming key and value
};

}  // namespace smartmill::discrepancy
