#include "smartmill_program/prediction/step_predictor.h"

#include "smartmill_core/units.h"

namespace smartmill::program {

/// Every probability is computed.
stability::RiskOptions StepPredictor::anyRisk() {
  stability::RiskOptions options;
  options.risk = 1.0;
  return options;
}

StepPredictor::OfTool& StepPredictor::of(int tool) {
  std::unique_ptr<OfTool>& place = tools_[tool];
  if (!place) {
    const MachineModel& model = models_.of(tool);
    place = std::make_unique<OfTool>(model, model.needCutting("predict forces"));
  }
  return *place;
}

StepPrediction StepPredictor::predict(const Step& step) {
  StepPrediction prediction;
  const Move& move = *step.move;
  if (step.air() || move.rapid || !(move.spindle_speed > 0.0)) return prediction;
  OfTool& tool = of(move.tool);
  prediction.feed_per_tooth =
      units::TWO_PI * move.feed / (move.spindle_speed * models_.of(move.tool).tool->teeth);
  if (step.contact.empty()) return prediction;
  const double speed = move.spindle_speed, feed = prediction.feed_per_tooth * step.feed_share;
  prediction.force = tool.force.predict(step.contact, feed);
  prediction.power = prediction.force.mean.torque * speed;
  prediction.chip = largestChip(*models_.of(move.tool).tool, step.contact, feed);
  if (!with_stability_ || !tool.limits.available()) return prediction;
  const EngagementCell cell = EngagementCell::of(step.contact, step.feed_angle, move.left_hand);
  const double depth = step.contact.axialDepth();
  prediction.limit = tool.limits.limit(cell, speed);
  if (with_probability_) prediction.chatter = tool.risk.rounded(cell, speed, depth).value_or(1.0);
  if (!(prediction.limit > depth)) return prediction;
  prediction.deflection = tool.tip.largest(tool.force, step.contact, cell, speed, feed);
  if (tool.walls.available())
    prediction.wall_error = tool.walls.error(step.contact, step.feed_angle, move.left_hand, speed, feed);
  return prediction;
}

std::size_t StepPredictor::computedLimits() const {
  std::size_t sum = 0;
  for (const auto& [number, tool] : tools_) sum += tool->limits.computed();
  return sum;
}

}  // namespace smartmill::program
