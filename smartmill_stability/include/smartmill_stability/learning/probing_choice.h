#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "smartmill_stability/chart/chart_parameters.h"
#include "smartmill_stability/learning/chart_learning.h"

namespace smartmill::stability {

/// The next cut of a machine without a tap test.
struct ProbingRequest {
  std::vector<JudgedCut> cuts;  ///< so far
  /// [N/m2] Tangential coefficient with its standard deviation, 0: not stated; empty: unknown.
  std::optional<Measured> ktc;
  double kte = 0.0;                          ///< [N/m] tangential edge coefficient
  double entry = 0.0, exit = units::PI;      ///< [rad] immersion angles, 0 <= entry < exit <= 2 pi
  double speed_low = 0.0, speed_high = 0.0;  ///< [rad/s] 0: those of the chart
  double max_depth = 0.0;                    ///< [m] at most that of the chart; 0: that of the chart
  bool last = false;                         ///< no further probing cut: only the recommended cut is chosen

  /// @throws Error naming quantity and value.
  void validate() const;
};

struct ProbingChoice {
  /// Empty after the last one, and if no cut of the range removes 5 % more than the recommended one.
  std::optional<CutProposal> next;
  /// Empty if no cut has an acceptable risk; judged by collocation.
  std::optional<CutProposal> recommended;
};

/// The next cut and the recommended one by ChartLearning, from wide distributions of the modes and the
/// measured tangential coefficient. Depths end where the cut reaches the share load_share of the rated torque
/// or power of the spindle. Takes seconds.
/// @throws Error on values out of range.
ProbingChoice chooseProbingCut(const ChartCut& cut, const ProbingRequest& request,
                               const LearningOptions& options = {});

}  // namespace smartmill::stability
