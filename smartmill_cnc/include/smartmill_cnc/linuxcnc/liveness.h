#pragma once

#include <algorithm>
#include <limits>

#include "smartmill_cnc/linuxcnc/process_watch.h"

namespace smartmill::cnc::linuxcnc {

/// Whether a controller that counts cycles lives. One that has stopped counting has ended, hangs, or waits
/// for a processor that an overloaded computer does not give it; only evidence tells the three apart.
class Liveness {
 public:
  static constexpr double HANGS = 0.4;       ///< [s] without a cycle and without an excuse
  static constexpr double STARVES = 2.0;     ///< [s] without a cycle whatever the excuse
  static constexpr double SUSPICIOUS = 0.1;  ///< [s] without a cycle: worth looking at its processes
  static constexpr double LONGEST_STEP =
      0.05;  ///< [s] between two looks; beyond it the observer itself waited

  enum class Verdict { lives, ended, hangs, starves };

  struct Evidence {
    bool beats = false;  ///< it has counted since the last look
    bool ended = false;  ///< one of its processes has
    bool waits = false;  ///< one of its threads wants a processor and gets none
  };

  /// @param now [s] any steady time
  Verdict look(const Evidence& evidence, double now) {
    const double step = std::max(0.0, now - last_), own = std::max(0.0, step - LONGEST_STEP);
    last_ = now;
    if (evidence.beats) {
      still_ = starved_ = 0.0;
    } else {
      still_ += evidence.waits ? 0.0 : std::min(step, LONGEST_STEP);
      starved_ += evidence.waits ? step : own;
    }
    return evidence.ended                ? Verdict::ended
           : still_ > HANGS              ? Verdict::hangs
           : still_ + starved_ > STARVES ? Verdict::starves
                                         : Verdict::lives;
  }
  /// The same with the evidence of its processes, which are looked at when it is due.
  Verdict look(bool beats, ProcessWatch& processes, double now) {
    return look({beats, processes.ended(), silent() > SUSPICIOUS && processes.waits(now)}, now);
  }
  /// [s] that it has not counted at all
  double silent() const { return still_ + starved_; }
  /// [s] of these that the computer is to blame for
  double starved() const { return starved_; }

 private:
  double still_ = 0.0, starved_ = 0.0, last_ = std::numeric_limits<double>::infinity();
};

}  // namespace smartmill::cnc::linuxcnc
