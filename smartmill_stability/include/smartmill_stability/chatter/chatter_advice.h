#pragma once

#include <deque>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_stability/chatter/chatter_detector.h"
#include "smartmill_stability/solvers/solver.h"

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

/// What to do about chatter in a running cut (topic chatter/advice).
struct ChatterAdvice {
  double stamp = 0.0;  ///< [s] of the window that confirmed the chatter
  ChatterEpisode episode;
  struct Speed {
    double speed = 0.0;      ///< [rad/s]
    double limit = 0.0;      ///< [m] by the corrected system; NaN without a believed one
    double frequency = 0.0;  ///< [Hz] at that limit
  };
  std::vector<Speed> speeds;  ///< fastest first
  double depth = 0.0;         ///< [m] of the cut
  double speed = 0.0;         ///< [rad/s] of the cut
  Engagement engagement;      ///< of the cut
  int teeth = 0;
  std::optional<ModeCorrection> correction;                           ///< of the believed system
  double believed_frequency = 0.0;                                    ///< [Hz] of the corrected mode before
  double believed_limit = std::numeric_limits<double>::quiet_NaN();   ///< [m] at the speed of the cut
  double corrected_limit = std::numeric_limits<double>::quiet_NaN();  ///< [m]
};

/// Follows the verdicts of a detector and gives advice once an episode, when two windows one after the other
/// agree on the frequency within 1 %: while chatter grows the first window may still name another line.
class ChatterAdvisor {
 public:
  /// The believed system of a cut, empty while modes or coefficients are missing.
  using Believed = std::function<std::optional<RegenerativeSystem>(const CuttingCondition&)>;
  using Output = std::function<void(const ChatterAdvice&)>;
  /// @param low, high [rad/s] speeds to propose @param teeth where the condition names none
  /// @param early gets the advice before limits are sought at the proposed speeds, which takes longest
  ChatterAdvisor(double low, double high, int teeth, Believed believed, Output output, Output early = {});

  /// Conditions may come ahead of the verdicts of the cut before.
  void handle(const CuttingCondition& condition);
  /// The speed that an override made of the commanded one.
  void handle(const CncState& state);
  /// @throws Error as the solvers on an impossible believed system.
  void handle(const ChatterState& state);
  /// The cut goes on in another way: what was seen until now tells nothing of it.
  void restart();

 private:
  void advise(const ChatterState& state);

  double low_, high_;
  int teeth_;
  Believed believed_;
  Output output_, early_;
  std::deque<CuttingCondition> conditions_;  // the newest few
  std::vector<ChatterState> running_;        // of the present episode
  bool advised_ = false;
  double actual_speed_ = 0.0;  // [rad/s]
};

}  // namespace smartmill::stability
