#pragma once

#include <map>
#include <tuple>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_program/engagement/contact.h"

namespace smartmill::program {

/// Stability limits of a tool for the engagements of a program, by collocation (smartmill_stability). They
/// are computed once per cell of a grid: the arc is widened to multiples of 5 degrees, which does not raise
/// its limit by much, and the feed direction is rounded to 15 degrees, since the modes of the model are those
/// of the axes of the machine.
class StabilityLimits {
 public:
  /// @throws Error when the model has no tool or coefficients
  explicit StabilityLimits(const MachineModel& model) : model_(model) {}

  /// Whether the model states modes of the tool tip or of the workpiece.
  bool available() const {
    return !model_.tool_tip.x.modes.empty() || !model_.tool_tip.y.modes.empty() ||
           !model_.workpiece_modes.empty();
  }
  /// [m] Largest stable axial depth, at most MOST_DEPTH tool radii. @param speed [rad/s] > 0
  double limit(const Contact& contact, double feed_angle, bool left_hand, double speed);
  std::size_t computed() const { return limits_.size(); }  ///< different limits so far

  static constexpr double MOST_DEPTH = 10.0;

 private:
  using Cell =
      std::tuple<int, int, int, int>;  // entry, exit, feed direction [grid steps], speed [rpm]; negative: M4

  const MachineModel& model_;
  std::map<Cell, double> limits_;
};

}  // namespace smartmill::program
