#pragma once

#include <map>
#include <utility>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_program/prediction/engagement_cell.h"

namespace smartmill::program {

/// Stability limits of a tool for the engagements of a program, by collocation (smartmill_stability). They
/// are computed once per cell and speed.
class StabilityLimits {
 public:
  /// @throws Error when the model has no tool or coefficients
  explicit StabilityLimits(const MachineModel& model) : model_(model) {}

  bool available() const { return hasModes(model_); }
  /// [m] Largest stable axial depth, at most MOST_DEPTH tool radii. @param speed [rad/s] > 0
  double limit(const EngagementCell& cell, double speed);
  double limit(const Contact& contact, double feed_angle, bool left_hand, double speed) {
    return limit(EngagementCell::of(contact, feed_angle, left_hand), speed);
  }
  std::size_t computed() const { return limits_.size(); }  ///< different limits so far

  static constexpr double MOST_DEPTH = 10.0;

 private:
  const MachineModel& model_;
  std::map<std::pair<EngagementCell, int>, double> limits_;  // by cell and speed [rpm]
};

}  // namespace smartmill::program
