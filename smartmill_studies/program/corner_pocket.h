#pragma once

#include <limits>
#include <random>
#include <string>

#include "smartmill_core/model/machine_model.h"

namespace smartmill {

/// The corner of a pocket that is open at two sides: roughed in levels, then finished at full depth along a
/// line, an arc about the centre of the roughing's arc, and a line. The engagement is constant on each of the
/// three and largest on the arc.
struct CornerPocket {
  double depth = 0.0;          ///< [m] of the finishing pass
  int levels = 1;              ///< of the roughing
  double step = 2e-3;          ///< [m] radial depth of the finishing pass along the lines
  double radius = 10e-3;       ///< [m] of its arc
  double speed = 420.0;        ///< [rad/s]
  double feed = 5e-5;          ///< [m] per tooth
  double corner_margin = 0.0;  ///< [1] drawn stability limit over depth on the arc, least over the
                               ///< directions of its constant engagement
  double line_margin = 0.0;    ///< [1] the same on the lines and in the roughing

  static constexpr double SIDE = 60e-3;  ///< [m] of the block
};

/// What is drawn.
struct CornerRanges {
  double low_margin = 0.5, high_margin = 0.8;                                    ///< [1] of the corner
  double least_time = 1.0, most_time = std::numeric_limits<double>::infinity();  ///< [s] of constant
                                                                                 ///< engagement on the arc
};

/// A machine and a pocket whose corner is unstable, with a margin of 0.5 to 0.8, while lines and roughing
/// have a margin of at least 1.25: modes of the tool tip, coefficients, tool, geometry and speed are drawn
/// until they fulfil this, and the engagement is constant for a second on the arc. The workpiece is the
/// block.
struct CornerCase {
  MachineModel machine;
  CornerPocket pocket;
};
CornerCase drawCornerCase(const MachineModel& base, std::mt19937_64& random, const CornerRanges& ranges = {});

/// In the dialect of a control with a program number; line numbers are those of CornerLines.
std::string cornerProgram(const CornerPocket& pocket, const MachineModel& machine);

}  // namespace smartmill
