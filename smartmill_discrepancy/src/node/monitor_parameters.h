#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_discrepancy/live/live_gap.h"
#include "smartmill_discrepancy/live/stretch_recorder.h"

namespace smartmill::discrepancy {

/// Parameters of the monitor and of `explain` on a bag.
struct MonitorParameters {
  std::string model;
  StretchParameters stretch;
  double hold_back = 0.05;
  LiveGapOptions gap;
  std::string record_folder;
  double record_after = 0.4;
  bool record_all = false;
  int most_recorded = 40;
  int most_per_condition = 2;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of the monitor (package smartmill_discrepancy): the twin beside the running machine.");
    table.atLaunch("model", model, "path of a smartmill-model/1 file: the twin that follows the machine");
    table.section();
    stretch.declare(table);
    table.number("hold_back", hold_back, "s", Range::notNegative(),
                 "that a condition may arrive after its stamp");
    gap.declare(table);
    table.text("record_folder", record_folder,
               "stretches that do not fit are kept here as a campaign for explain; empty: not kept");
    table.number(
        "record_after", record_after, "s", Range::notNegative(),
        "that a cut has run before a stretch is kept: vibrations of the entry die out slowly in light cuts");
    table.flag("record_all", record_all, "stretches that fit are kept too");
    table.number("most_recorded", most_recorded, "1", Range::notNegative(), "stretches kept");
    table.number("most_per_condition", most_per_condition, "1", Range::notNegative(),
                 "of each cutting condition");
  }
  void validate() const { checkBounds(*this); }  ///< @throws Error naming key and value
};

}  // namespace smartmill::discrepancy
