#pragma once

#include <tuple>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_program/engagement/contact.h"
#include "smartmill_stability/solvers/solver.h"

namespace smartmill::program {

/// Engagements with nearly the same stability: the hull of the arcs is widened to multiples of 5 degrees,
/// which does not raise its limit by much, and the feed direction is rounded to 15 degrees, since the modes
/// of the model are those of the axes of the machine.
struct EngagementCell {
  int entry = 0, exit = 0;  ///< [5 deg]
  int direction = 0;        ///< [15 deg]
  bool left_hand = false;

  /// @param feed_angle [rad] as in Step
  static EngagementCell of(const Contact& contact, double feed_angle, bool left_hand);
  /// The machine that cuts in this engagement, its modes in the feed frame.
  stability::RegenerativeSystem system(const MachineModel& model) const;
  bool operator<(const EngagementCell& other) const { return key() < other.key(); }

 private:
  std::tuple<int, int, int, bool> key() const { return {entry, exit, direction, left_hand}; }
};

/// Whether a model states modes of the tool tip or of the workpiece, without which no cut chatters.
bool hasModes(const MachineModel& model);

}  // namespace smartmill::program
