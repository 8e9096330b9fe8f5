#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartmill_stability/chatter_detector.h"
#include "smartmill_stability/solver.h"

namespace smartmill::stability {

/// One stretch of chatter in a cut, from the verdicts of its windows.
struct ChatterEpisode {
  std::string condition;
  double onset = 0.0;      ///< [s] first revolution whose force no longer repeats
  double detected = 0.0;   ///< [s] end of the window that said so
  double end = 0.0;        ///< [s] of the last window with chatter
  double frequency = 0.0;  ///< [Hz] median over the windows
  double severity = 0.0;   ///< [N] largest
};

/// Joins verdicts to episodes: consecutive windows of one condition that chatter.
std::vector<ChatterEpisode> episodes(const std::vector<ChatterState>& states);

/// Spindle speeds [rad/s] at which the tooth passing frequency, or a whole multiple, meets the chatter
/// frequency, so that succeeding teeth leave parallel waves: 2 pi f / (k teeth), k = 1, 2, ..., within
/// low..high [rad/s], fastest first.
std::vector<double> speedsFromChatter(double frequency, int teeth, double low, double high);

/// What an observed chatter frequency says about the believed system.
struct ModeCorrection {
  std::size_t mode = 0;       ///< which one of the system's
  double factor = 1.0;        ///< [1] its frequency over the believed one
  double frequency = 0.0;     ///< [Hz] the corrected mode's
  bool chatters = false;      ///< the corrected system chatters at that speed and depth
  RegenerativeSystem system;  ///< corrected
};

/// The smallest change of one mode's frequency with which the dominant motion of the system at a speed
/// [rad/s] and depth [m] has the observed frequency, or differs from it by whole multiples of the tooth
/// passing frequency (a force shows those stronger at times). Corrections that chatter come first. @param
/// most [1] largest change tried; empty when nothing fits.
std::optional<ModeCorrection> correctFromChatter(const RegenerativeSystem& believed, double speed,
                                                 double depth, double observed, double most = 0.1);

}  // namespace smartmill::stability
