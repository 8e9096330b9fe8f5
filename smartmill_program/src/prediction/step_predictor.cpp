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
  prediction.force = tool.force.predict(step.contact, prediction.feed_per_tooth * step.feed_share);
  prediction.power = prediction.force.mean.torque * move.spindle_speed;
  if (with_stability_ && tool.limits.available()) {
    const EngagementCell cell = EngagementCell::of(step.contact, step.feed_angle, move.left_hand);
    prediction.limit = tool.limits.limit(cell, move.spindle_speed);
    if (with_probability_)
      prediction.chatter =
          tool.risk.rounded(cell, move.spindle_speed, step.contact.axialDepth()).value_or(1.0);
  }
  if (with_stability_ && tool.walls.available() && prediction.limit > step.contact.axialDepth())
    prediction.wall_error = tool.walls.error(step.contact, step.feed_angle, move.left_hand,
                                             move.spindle_speed, prediction.feed_per_tooth * step.feed_share);
  return prediction;
}

std::size_t StepPredictor::computedLimits() const {
  std::size_t sum = 0;
  for (const auto& [number, tool] : tools_) sum += tool->limits.computed();
  return sum;
}

}  // namespace smartmill::program
