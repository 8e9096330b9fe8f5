#pragma once

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::program {

struct FollowerParameters {
  int number = 0;
  double path_tolerance = 2.0e-4;
  double position_std = 1.0e-5;
  double feed_tolerance = 0.03;
  double speed_tolerance = 0.01;
  double steady_time = 0.1;
  double longest_gap = 0.5;

  void declare(ParameterTable& table) {
    table.number("number", number, "1", Range::closed(0, 99999999),
                 "O number of the program on the controller; 0: any program that follows the path");
    table.number("path_tolerance", path_tolerance, "m", Range::openLow(0.0, 0.01),
                 "largest distance of the tool from the path: rounded corners and error of the program zero");
    table.number("position_std", position_std, "m", Range::openLow(0.0, 1.0e-3),
                 "standard deviation of the tool's position across the path");
    table.number("feed_tolerance", feed_tolerance, "1", Range::openLow(0.0, 0.5),
                 "range of the actual feed, relative to its mean, within which it is steady");
    table.number("speed_tolerance", speed_tolerance, "1", Range::openLow(0.0, 0.5),
                 "the same of the spindle speed");
    table.number("steady_time", steady_time, "s", Range::openLow(0.0, 10.0),
                 "time of steady feed and speed before a condition begins; five states of the controller");
    table.number("longest_gap", longest_gap, "s", Range::openLow(0.0, 60.0),
                 "longest time without a state after which the place on the path is still taken from the "
                 "previous one");
  }
};

}  // namespace smartmill::program
