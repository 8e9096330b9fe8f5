#pragma once

#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_stability/chatter/chatter_advice.h"
#include "smartmill_stability/solvers/solver.h"
#include "stability/study_range.h"

namespace smartmill::stability {

struct DetectionOptions : StudyRange {
  int cuts = 300;
  int first = 0;  ///< [1] >= 0 number of the first: even ones are to chatter, odd ones not
  /// force: fx, fy, fz with the model's noise; vibration: acceleration of the tip; sound: pressure that goes
  /// with the tip's acceleration. Noise of the latter two: a share of the signal's rms.
  std::string signal = "force";
  double signal_noise = 0.02;  ///< [1] >= 0
  ChatterParameters detector{};
};

struct DetectionCut {
  double speed = 0.0, depth = 0.0;  ///< [rad/s], [m]
  double radius = 0.0;              ///< [1] of the solver's dominant multiplier
  bool chattersBySolver() const { return radius > 1.0; }
  /// What the simulator's record of the same cut without noise and effects says of the tip's motion, sampled
  /// once per tooth (uneven pitch: per revolution): it repeats no more to the end.
  bool chatters = false;
  double onset = 0.0;      ///< [s] first revolution from which it repeats no more
  double frequency = 0.0;  ///< [Hz] strongest line of the noiseless signal beside what repeats
  bool found = false;
  double detected = 0.0;         ///< [s] end of the first window that says chatter
  double found_frequency = 0.0;  ///< [Hz]
  double alternation = 0.0;      ///< [1] largest of all windows
  double energy = 0.0;           ///< [1] energy ratio, largest of all windows
};

/// Simulated cuts with the model's noise and effects (runout), a sudden entry after some turns in air and a
/// sudden end, at random speeds and at 0.4 .. 0.9 and 1.2 .. 2 times the believed limit, through the
/// detector.
std::vector<DetectionCut> detectionStudy(const MachineModel& model, const RegenerativeSystem& system,
                                         const DetectionOptions& options,
                                         const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
