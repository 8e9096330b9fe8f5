#pragma once

#include "smartmill_core/model/machine_model.h"
#include "smartmill_program/prediction/engagement_cell.h"
#include "smartmill_program/prediction/force_predictor.h"

namespace smartmill::program {

/// Displacement of the tool tip against the workpiece in a stable cut: the response of the modes to the
/// harmonics of the force over a revolution. In a stable cut with alike teeth the regeneration cancels. The
/// cut is not changed by the displacement. The harmonics end at three times the highest natural frequency.
class TipDeflection {
 public:
  explicit TipDeflection(const MachineModel& model) : model_(model) {}

  bool available() const { return hasModes(model_); }
  /// [m] largest across the tool axis over a revolution. @param forces of the tool @param cell of the contact
  /// @param speed [rad/s] > 0 @param feed_per_tooth [m] horizontal
  double largest(ForcePredictor& forces, const Contact& contact, const EngagementCell& cell, double speed,
                 double feed_per_tooth);

 private:
  const MachineModel& model_;
  // The last one; along a straight cut it stays the same.
  Contact contact_;
  EngagementCell cell_;
  double speed_ = 0.0, feed_per_tooth_ = 0.0, largest_ = 0.0;
};

}  // namespace smartmill::program
