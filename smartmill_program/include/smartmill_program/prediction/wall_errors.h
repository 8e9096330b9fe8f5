#pragma once

#include <map>
#include <tuple>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_program/engagement/contact.h"

namespace smartmill::program {

/// Surface location error of the wall that a peripheral cut leaves
/// (smartmill_stability/chart/surface_error.h), for the engagements of a program. It is computed once per
/// cell of a grid: angles are rounded to 1 degree, depth and feed per tooth to 2 %, the feed direction to 15
/// degrees.
class WallErrors {
 public:
  explicit WallErrors(const MachineModel& model) : model_(model) {}

  /// Whether the model states modes of the tool tip, edge coefficients and a flat end mill with one helix
  /// angle.
  bool available() const;
  /// [m] > 0: overcut; NaN: the contact generates no wall or two (one arc from the tip up, entry 0 or exit
  /// pi, is required). Valid for a stable cut. @param speed [rad/s] > 0
  double error(const Contact& contact, double feed_angle, bool left_hand, double speed,
               double feed_per_tooth);

 private:
  using Cell = std::tuple<int, int, int, int, int, int>;

  const MachineModel& model_;
  std::map<Cell, double> errors_;
};

}  // namespace smartmill::program
