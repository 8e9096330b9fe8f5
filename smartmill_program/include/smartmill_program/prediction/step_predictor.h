#pragma once

#include <cstddef>
#include <limits>
#include <map>
#include <memory>

#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/prediction/chatter_risk.h"
#include "smartmill_program/prediction/force_predictor.h"
#include "smartmill_program/prediction/stability_limits.h"
#include "smartmill_program/prediction/tip_deflection.h"
#include "smartmill_program/prediction/tool_models.h"
#include "smartmill_program/prediction/wall_errors.h"

namespace smartmill::program {

/// What is predicted of a step; NaN: not predicted.
struct StepPrediction {
  double feed_per_tooth = std::numeric_limits<double>::quiet_NaN();  ///< [m] along the path
  ForcePrediction force;                                             ///< of the side of the tool
  double power = 0.0;                                                ///< [W] mean, of the cut
  double chip = std::numeric_limits<double>::quiet_NaN();            ///< [m] largest thickness
  double deflection = std::numeric_limits<double>::quiet_NaN();      ///< [m] of the tip, of a stable cut
  double limit = std::numeric_limits<double>::quiet_NaN();           ///< [m] stability limit
  double chatter = std::numeric_limits<double>::quiet_NaN();         ///< [1] probability of chatter
  double wall_error = std::numeric_limits<double>::quiet_NaN();      ///< [m] of a stable cut (WallErrors)
};

/// Predicts forces and stability of the steps of a program, each with the model of its tool.
class StepPredictor {
 public:
  /// @param with_stability computes limits for the models that state modes of the tool tip
  /// @param with_probability the probabilities of chatter as well
  StepPredictor(ToolModels& models, bool with_stability, bool with_probability = false)
      : models_(models), with_stability_(with_stability), with_probability_(with_probability) {}

  /// @throws Error naming what a model lacks
  StepPrediction predict(const Step& step);
  std::size_t computedLimits() const;

 private:
  struct OfTool {
    OfTool(const MachineModel& model, const CuttingCoefficients& cutting)
        : force(*model.tool, cutting), limits(model), risk(model, anyRisk()), walls(model), tip(model) {}
    ForcePredictor force;
    StabilityLimits limits;
    ChatterRisk risk;
    WallErrors walls;
    TipDeflection tip;
  };
  static stability::RiskOptions anyRisk();
  OfTool& of(int tool);

  ToolModels& models_;
  bool with_stability_, with_probability_;
  std::map<int, std::unique_ptr<OfTool>> tools_;
};

}  // namespace smartmill::program
