#pragma once

#include <map>

#include "smartmill_program/engagement/cut_simulation.h"
#include "smartmill_program/plan/feed_limits.h"
#include "smartmill_program/prediction/tool_models.h"

namespace smartmill::program {

/// The largest feed at which a step holds the limits. The force of the mechanistic model is affine in the
/// feed per tooth at each spindle angle, so that every limit is the root of a quadratic or linear equation:
///
///     |edges + c chip|^2 = force^2,    torque and power: edges + c chip = limit
class StepBounds {
 public:
  /// @param speed_ratios [1] planned over original speed by the line of the S word
  StepBounds(ToolModels& models, const FeedLimits& limits, const std::map<int, double>& speed_ratios)
      : models_(models), limits_(limits), speed_ratios_(speed_ratios) {}

  /// The feed of a step of the end face, which has no force model, is at most originalFeed(). In air
  /// only the machine limits the feed, which is not part of the result.
  /// @throws Error when the edge forces alone exceed a limit
  FeedBound of(const Step& step) const;
  /// Of a whole move, without its forces: machine, acceleration towards the centre of an arc.
  FeedBound of(const Move& move) const;

  /// [m/s] with the feed per tooth of the program at its original speed
  double originalFeed(const Move& move) const;

 private:
  void boundForces(const Step& step, const MachineModel& model, double speed_of_chip, FeedBound& bound) const;

  ToolModels& models_;
  const FeedLimits& limits_;
  const std::map<int, double>& speed_ratios_;
};

}  // namespace smartmill::program
