#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/control/milling_control.h"
#include "stability/study_range.h"

namespace smartmill::stability {

struct ControlOptions : StudyRange {
  int cuts = 100;
  double reaction = 0.2;                 ///< [s] from an advice to the controller's new overrides
  double spindle_acceleration = 1000.0;  ///< [rad/s2]
  double noise = 3.0;                    ///< [N] of the force sensor, rms
  int revolutions = 900;                 ///< [1] most of a cut
  ChatterParameters detector{};
  MillingControlParameters control{};
};

/// One cut that would chatter to its end, with the control switched on.
struct ControlCut {
  double speed = 0.0, depth = 0.0;  ///< [rad/s], [m] programmed
  double limit = 0.0;               ///< [m] of the true machine there
  double onset = 0.0;               ///< [revolutions] the tip's motion repeats no more
  double asked = 0.0;               ///< [revolutions] at which overrides were first asked for; NaN: never
  double ended = 0.0;  ///< [revolutions] from which it repeats again to the end; NaN: it does not
  int moves = 0;
  double spindle = 1.0, feed = 1.0;  ///< [1] overrides at the end
  /// [1] removal rate over the programmed one: with the control (where the cut cannot be saved, of the next
  /// one); of an operator who halves the depth until the true machine is stable
  double removal = 0.0, careful = 0.0;
  double next_speed = 0.0, next_depth = 0.0;  ///< [rad/s], [m] said for the next cut; 0: nothing
  bool next_stable = false;                   ///< on the true machine
  double thinking = 0.0;                      ///< [s] of the computer for all advice
  std::string said;                           ///< the reason of the last request
  bool end() const { return ended >= 0.0; }
};

/// Cuts in the time domain of smartmill_sim on machines drawn from a model's deviations, while detection,
/// advice and control know the model alone. Speeds at random, depths 1.2 .. 2 times the limit of the drawn
/// machine, only such that chatter there. The spindle changes its speed with its acceleration, the tool and
/// the surface it left go on.
std::vector<ControlCut> controlStudy(const MachineModel& model, const RegenerativeSystem& system,
                                     const ControlOptions& options,
                                     const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
