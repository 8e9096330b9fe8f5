#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"
#include "stability/study_range.h"

namespace smartmill::stability {

struct BoundaryOptions : StudyRange {
  double entry_deg = 0.0, exit_deg = 180.0;
  double side = 0.03;    ///< [1] of the limit: depth of the two cuts below and above it
  double feed = 0.1e-3;  ///< [m] per tooth
  int points = 60;
  int revolutions = 400;  ///< [1] in cut
  std::optional<SpeedVariation> variation = std::nullopt;
};

/// Two cuts of the twin at the sides of a limit.
struct SidedLimit {
  double speed = 0.0;     ///< [rad/s] mean
  double position = 0.0;  ///< [m] along the part; 0 without several places
  Limit limit;
  bool below_chatters = false, above_chatters = false;
  bool agrees() const { return !below_chatters && above_chatters; }
};

/// Random speeds and, where the model states several places of its workpiece, positions: limits by
/// collocation and simulated cuts below and above them. Points without a limit are drawn again.
/// @throws Error on a variation that does not last a whole number of revolutions.
std::vector<SidedLimit> agreementAtBoundary(const MachineModel& model, const BoundaryOptions& options,
                                            const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
