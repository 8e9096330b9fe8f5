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
  int first = 0;  ///< [1] >= 0 number of the first cut: even ones chatter, odd ones do not
  /// force: fx, fy, fz with the model's noise; vibration: acceleration of the tip; sound: pressure in
  /// proportion to the tip's acceleration. Noise of the latter two: a share of the RMS of the signal.
  std::string signal = "force";
  double signal_noise = 0.02;  ///< [1] >= 0
  ChatterParameters detector{};
};

struct DetectionCut {
  double speed = 0.0, depth = 0.0;  ///< [rad/s], [m]
  double radius = 0.0;              ///< [1] of the solver's dominant multiplier
  bool chattersBySolver() const { return radius > 1.0; }
  /// Whether the motion of the tip does not repeat to the end, sampled once per tooth (uneven pitch: per
  /// revolution), in the simulated record of the same cut without noise and effects.
  bool chatters = false;
  double onset = 0.0;      ///< [s] first revolution that does not repeat
  double frequency = 0.0;  ///< [Hz] strongest asynchronous line of the noiseless signal
  bool found = false;
  double detected = 0.0;         ///< [s] end of the first window with chatter
  double found_frequency = 0.0;  ///< [Hz]
  double alternation = 0.0;      ///< [1] largest of all windows
  double energy = 0.0;           ///< [1] energy ratio, largest of all windows
};

/// Simulated cuts with the model's noise and effects (runout), a sudden entry after some revolutions in air
/// and a sudden end, at random speeds and at 0.4 .. 0.9 and 1.2 .. 2 times the limit of the model, evaluated
/// by the detector.
std::vector<DetectionCut> detectionStudy(const MachineModel& model, const RegenerativeSystem& system,
                                         const DetectionOptions& options,
                                         const std::function<void(double)>& progress = {});

}  // namespace smartmill::stability
