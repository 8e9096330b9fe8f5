#pragma once

#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_sim/world/world.h"

namespace smartmill::sim {

/// Parameters of sim_node.
struct NodeParameters {
  std::string model, magazine;
  int port = 8193;
  std::string bind = "127.0.0.1";
  std::string axes_input;
  WorldOptions world;
  double most_behind = 0.25;
  double pace = 1.0;

  // Set by programs only.
  double truth_step = 2.0, truth_end = 6000.0;  ///< [Hz] lines of the true FRFs, which cover measured bands
  double poll_period = 2e-3;  ///< [s] of waiting for an external controller: two of its cycles
  double wait_share = 0.8;  ///< [1] of most_behind, for which samples of the external controller are awaited

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of sim_node (package smartmill_sim): the simulated machine. SI units throughout.");
    table.atLaunch("model", model, "path of a smartmill-model/1 file");
    table.atLaunch("magazine", magazine,
                   "paths of smartmill-model/1 files with the tools to which M6 changes, N=FILE for tool N, "
                   "separated by blanks; without it there is no tool change");
    table.section();
    table.number("port", port, "1", Range::closed(0, 65535), "FOCAS port of the controller; 0: any free one");
    table.text("bind", bind, "address to listen on");
    table.text("axes_input", axes_input,
               "topic (SampleBlock: x, y, z, revolutions) of an external controller of axes and spindle; "
               "empty: the simulated controller");
    world.declare(table);
    table.number("most_behind", most_behind, "s", Range::atLeast(0.05),
                 "largest lag behind the clock; beyond it samples are lost, as with a real device; not used "
                 "with /use_sim_time, where the clock is held back");
    table.number("pace", pace, "1", Range::closed(0.01, 100.0),
                 "simulated time per wall time with /use_sim_time, at most: a slow computer takes longer");
  }
  /// @throws Error naming key and value.
  void validate() const {
    checkBounds(*this);
    if (world.pulse_train && !axes_input.empty())
      throw Error("pulse_train: true, expected false with axes_input, whose source publishes spindle/angle");
  }
};

}  // namespace smartmill::sim
