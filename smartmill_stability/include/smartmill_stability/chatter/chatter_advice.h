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

/// [1] Largest relative difference of the frequencies of two windows with the same chatter: while chatter
/// grows, the first window may contain another dominant line.
inline constexpr double SAME_CHATTER = 0.01;

/// Uninterrupted chatter in one cut, from the verdicts of consecutive windows.
struct ChatterEpisode {
  std::string condition;
  double onset = 0.0;      ///< [s] first revolution whose force no longer repeats
  double detected = 0.0;   ///< [s] end of the first window with chatter
  double end = 0.0;        ///< [s] end of the last window with chatter
  double frequency = 0.0;  ///< [Hz] median over the windows
  double severity = 0.0;   ///< [N] maximum over the windows
};

/// Joins consecutive windows of one condition with chatter to episodes.
std::vector<ChatterEpisode> episodes(const std::vector<ChatterState>& states);

/// Spindle speeds [rad/s] at which the chatter frequency is an integer multiple of the tooth passing
/// frequency, so that consecutive teeth leave parallel waves: 2 pi f / (k teeth), k = 1, 2, ..., within
/// low..high [rad/s], highest first. @throws Error on values out of range.
std::vector<double> speedsFromChatter(double frequency, int teeth, double low, double high);

/// Correction of one mode of the prior system from an observed chatter frequency.
struct ModeCorrection {
  std::size_t mode = 0;       ///< index into the modes of the system
  double factor = 1.0;        ///< [1] corrected frequency over the prior one
  double frequency = 0.0;     ///< [Hz] corrected
  bool chatters = false;      ///< whether the corrected system chatters at that speed and depth
  RegenerativeSystem system;  ///< corrected
};

/// The smallest change of one modal frequency for which the dominant motion of the system at a speed [rad/s]
/// and depth [m] has the observed frequency [Hz], modulo the tooth passing frequency (a sideband may dominate
/// the force). Corrections with which the system chatters take precedence. Empty when no correction fits.
/// @param most [1] largest relative change. @throws Error on values out of range.
std::optional<ModeCorrection> correctFromChatter(const RegenerativeSystem& prior, double speed, double depth,
                                                 double observed, double most = 0.1);

/// Advice against chatter in a running cut (topic chatter/advice).
struct ChatterAdvice {
  double stamp = 0.0;  ///< [s] of the window that confirmed the chatter
  ChatterEpisode episode;
  struct Speed {
    double speed = 0.0;      ///< [rad/s]
    double limit = 0.0;      ///< [m] of the corrected system; NaN without a prior system
    double frequency = 0.0;  ///< [Hz] at that limit
  };
  std::vector<Speed> speeds;  ///< largest limit first; without limits highest speed first
  double depth = 0.0;         ///< [m] of the cut
  double speed = 0.0;         ///< [rad/s] of the cut
  Engagement engagement;      ///< of the cut
  int teeth = 0;
  std::optional<ModeCorrection> correction;                           ///< of the prior system
  double believed_frequency = 0.0;                                    ///< [Hz] prior, of the corrected mode
  double believed_limit = std::numeric_limits<double>::quiet_NaN();   ///< [m] prior, at the speed of the cut
  double corrected_limit = std::numeric_limits<double>::quiet_NaN();  ///< [m] at the speed of the cut
};

/// Gives advice once per episode, when two consecutive windows agree on the frequency within 1 %: while
/// chatter grows, the first window may contain another dominant line.
class ChatterAdvisor {
 public:
  /// Provides the prior system of a cut; empty while modes or coefficients are missing.
  using PriorSystem = std::function<std::optional<RegenerativeSystem>(const CuttingCondition&)>;
  using Output = std::function<void(const ChatterAdvice&)>;
  /// @param low, high [rad/s] range of the proposed speeds @param teeth of conditions that state none
  /// @param early receives the advice before the limits at the proposed speeds are computed, which takes
  /// longest
  ChatterAdvisor(double low, double high, int teeth, PriorSystem prior, Output output, Output early = {});

  /// May precede the last verdicts of the previous cut.
  void handle(const CuttingCondition& condition);
  /// Provides the actual spindle speed, which differs from the commanded one under an override.
  void handle(const CncState& state);
  /// @throws Error as the solvers on an invalid prior system.
  void handle(const ChatterState& state);
  /// Discards the verdicts so far, after the cut has changed.
  void restart();

 private:
  void advise(const ChatterState& state);

  double low_, high_;
  int teeth_;
  PriorSystem prior_system_;
  Output output_, early_;
  std::deque<CuttingCondition> conditions_;  // most recent
  std::vector<ChatterState> running_;        // of the current episode
  bool advised_ = false;
  double actual_speed_ = 0.0;  // [rad/s]
};

}  // namespace smartmill::stability
