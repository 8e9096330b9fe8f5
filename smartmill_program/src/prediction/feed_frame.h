#pragma once

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::program {

/// Number of the feed direction on a grid of 15 degrees; opposite directions have the same dynamics.
int directionCell(double feed_angle);

/// The machine that cuts an arc [deg], its modes in the feed frame of a direction on that grid.
stability::RegenerativeSystem systemInFeedFrame(const MachineModel& model, double entry_deg, double exit_deg,
                                                int direction, bool left_hand);

}  // namespace smartmill::program
