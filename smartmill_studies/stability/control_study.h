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
  int revolutions = 900;                 ///< [1] largest length of a cut
  ChatterParameters detector{};
  MillingControlParameters control{};
};

/// One cut with chatter, with the control switched on.
struct ControlCut {
  double speed = 0.0, depth = 0.0;  ///< [rad/s], [m] programmed
  double limit = 0.0;               ///< [m] of the true machine there
  double onset = 0.0;               ///< [revolutions] at which the motion of the tip stops repeating
  double requested = 0.0;           ///< [revolutions] of the first override request; NaN: none
  double ended = 0.0;               ///< [revolutions] from which it repeats to the end; NaN: never
  int moves = 0;
  double spindle = 1.0, feed = 1.0;  ///< [1] overrides at the end
  /// [1] removal rate over the programmed one: with the control (of the next cut if the chatter does not
  /// end); of an operator who halves the depth until the true machine is stable
  double removal = 0.0, careful = 0.0;
  double next_speed = 0.0, next_depth = 0.0;  ///< [rad/s], [m] recommended for the next cut; 0: none
  bool next_stable = false;                   ///< on the true machine
  double thinking = 0.0;                      ///< [s] computing time of all advice
  std::string reason;                         ///< the reason of the last request
  bool end() const { return ended >= 0.0; }
};

/// Cuts in the time domain of smartmill_sim on machines drawn from the standard deviations of a model, while
/// detection, advice and control use only the model. Random speeds, depths of 1.2 .. 2 times the limit of the
/// drawn machine, only cuts that chatter. The spindle changes its speed with limited acceleration; tool
/// motion and surface are continuous.
std::vector<ControlCut> controlStudy(const MachineModel& model, const RegenerativeSystem& system,
                                     const ControlOptions& options,
                                     const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
