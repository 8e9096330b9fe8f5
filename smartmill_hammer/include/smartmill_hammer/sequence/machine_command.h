#pragma once

#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"

namespace smartmill::hammer {

struct Waypoint {
  Axes3 position{{0, 0, 0}};  ///< [m] machine
  double feed = 0.0;          ///< [m/s] 0: rapid
};

/// A command to the machine.
struct Command {
  enum class Kind { orient, jog, move, strike, stop };
  Kind kind = Kind::stop;      ///< stop: abandon the motion in progress
  double stamp = 0.0;          ///< [s] of the input that caused it
  double angle = 0.0;          ///< [rad] orient: 0..2 pi
  std::string axis;            ///< jog: x, y or z
  double distance = 0.0;       ///< [m] jog
  double feed = 0.0;           ///< [m/s] jog
  Axes3 from{{0, 0, 0}};       ///< [m] move: machine position at the start of the path
  std::vector<Waypoint> path;  ///< move
  std::string direction;       ///< strike
};

/// NC text of a move in mm and mm/min, one block per waypoint. Incremental, so that machine positions can be
/// used without the work offset.
std::string moveProgram(const Axes3& from, const std::vector<Waypoint>& path);

}  // namespace smartmill::hammer
