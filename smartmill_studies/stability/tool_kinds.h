#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/solvers/solver.h"
#include "stability/study_range.h"

namespace smartmill::stability {

/// A tool with edges of one shape.
struct ToolKind {
  std::string name;
  ToolGeometry tool;
  /// Teeth with different chips: the chart takes their contact in the forced vibration.
  bool unlike_chips = false;
};

/// Straight, bull nose, ball, face mill of 45 degrees, variable pitch, variable helix, serrated: variants of
/// a tool with four teeth. @throws Error on another number of teeth.
std::vector<ToolKind> toolKinds(const ToolGeometry& straight);

struct ToolKindOptions : StudyRange {
  double entry_deg = 0.0, exit_deg = 180.0;
  double reach = 0.10;   ///< [1] largest distance of a cut from the limit, over the limit
  double within = 0.03;  ///< [1] distance of a cut from the limit that counts as right on either side
  double feed = 0.1e-3;  ///< [m] per tooth
                         ///< below the limit
  int points = 60;
  int revolutions = 400;  ///< [1] in cut
};

/// A cut of the twin near the limit at its speed.
struct CutAtLimit {
  double speed = 0.0;  ///< [rad/s]
  double limit = 0.0;  ///< [m]
  double depth = 0.0;  ///< [m]
  Kind kind = Kind::none;
  bool chatters = false;  ///< by the multiplier
  bool observed = false;  ///< in time
  bool right(double within) const;
};

/// Cuts at random speeds and depths about the limit of a tool. Speeds without a limit are drawn again.
/// @param model its tool is replaced @throws Error when no limits are found.
std::vector<CutAtLimit> cutsAtLimit(const MachineModel& model, const ToolKind& kind,
                                    const ToolKindOptions& options,
                                    const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
