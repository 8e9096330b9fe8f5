#pragma once

#include <array>
#include <string>

#include "smartmill_core/parameters/parameter_table.h"
#include "smartmill_program/live/follower_parameters.h"
#include "smartmill_program/live/live_program.h"

namespace smartmill::program {

/// Parameters of program_node.
struct NodeParameters {
  std::string program, models, stock_file;
  bool linuxcnc = false;
  std::array<double, 3> stock_size{{0, 0, 0}}, stock_corner{{0, 0, 0}}, program_zero{{0, 0, 0}};
  double resolution = 1.0e-4;
  double step_share = SimulationOptions().step_share;
  std::string tool = "end_mill", material;
  StretchParameters stretches;
  FollowerParameters follower;
  double progress_period = 0.25;
  double radial_ratio = 0.3;
  double hold_back = 0.05;
  double input_timeout = 1.0;

  void declare(ParameterTable& table) {
    table.title(
        "Parameters of program_node (package smartmill_program): cutting conditions of a running NC "
        "program.");
    table.atLaunch("program", program, "path of the NC program");
    table.atLaunch(
        "models", models,
        "path of a smartmill-model/1 file with the tool; N=FILE for tool N of several, separated by "
        "blanks");
    table.section("Stock and zero.");
    table.list(
        "stock_size", stock_size, "m", Range::notNegative(),
        "size of the stock along X, Y, Z; all 0: the workpiece of the model, and stock_corner is unused");
    table.list("stock_corner", stock_corner, "m", Range(),
               "corner of the stock of least X, Y, Z in the coordinates of the program");
    table.text("stock_file", stock_file,
               "STL file of the stock (mm, coordinates of the program), in place of a block; empty: none");
    table.list("program_zero", program_zero, "m", Range(),
               "machine position at which the tip of the tool is at the zero of the program");
    table.number("resolution", resolution, "m", Range::openLow(0.0, 0.01),
                 "width of the columns of the stock");
    table.number("step_share", step_share, "1", Range::openLow(0.0, 1.0), "length of a step per tool radius");
    table.flag("linuxcnc", linuxcnc, "true: LinuxCNC's own interpreter (rs274) reads the program");
    table.section("Names in conditions and results.");
    table.text("tool", tool, "name of the tool; of several, T and its number are appended");
    table.text("material", material, "workpiece material; empty: that of the model's workpiece");
    table.section("Steady stretches.");
    stretches.declare(table);
    table.section("Place of the tool on the path.");
    follower.declare(table);
    table.section("Comparison with the prediction.");
    table.number("progress_period", progress_period, "s", Range::openLow(0.0, 10.0),
                 "time of a stretch whose force is compared with its prediction");
    table.number(
        "kr", radial_ratio, "1", Range::notNegative(),
        "radial over tangential coefficient, used while the radial one is not identified; the radial "
        "edge coefficient is then the tangential one");
    table.number("hold_back", hold_back, "s", Range::closed(0.0, 10.0),
                 "maximum delay of a verdict after its stamp");
    table.section();
    table.number("input_timeout", input_timeout, "s", Range::positive(),
                 "time without a state of the controller after which diagnostics report a dead input");
  }
  /// @throws Error naming key and value.
  void validate() const { checkBounds(*this); }
};

}  // namespace smartmill::program
