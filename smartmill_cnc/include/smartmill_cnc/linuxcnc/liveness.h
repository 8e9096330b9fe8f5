#pragma once

#include <algorithm>
#include <limits>

#include "smartmill_cnc/linuxcnc/process_watch.h"

namespace smartmill::cnc::linuxcnc {

struct LivenessOptions {
  double hangs = 0.4;       ///< [s] without a cycle although a processor is available: reported within 0.5 s
  double starves = 2.0;     ///< [s] without a cycle for any reason: too slow to run a controller
  double suspicious = 0.1;  ///< [s] without a cycle before its processes are checked, which costs time
  double longest_step = 0.05;  ///< [s] between two updates; beyond it the observer itself waited
};

/// Whether a controller that counts cycles is alive. If the count stops, the controller has ended, hangs, or
/// waits for a processor on an overloaded computer; the evidence distinguishes these cases.
class Liveness {
 public:
  enum class Verdict { lives, ended, hangs, starves };

  struct Evidence {
    bool beats = false;  ///< it has counted since the last update
    bool ended = false;  ///< one of its processes has ended
    bool waits = false;  ///< one of its threads waits for a processor
  };

  explicit Liveness(const LivenessOptions& options = {}) : options_(options) {}

  /// @param now [s] any steady time
  Verdict update(const Evidence& evidence, double now) {
    const double step = std::max(0.0, now - last_), own = std::max(0.0, step - options_.longest_step);
    last_ = now;
    if (evidence.beats) {
      silent_ = starved_ = 0.0;
    } else {
      silent_ += evidence.waits ? 0.0 : std::min(step, options_.longest_step);
      starved_ += evidence.waits ? step : own;
    }
    return evidence.ended                          ? Verdict::ended
           : silent_ > options_.hangs              ? Verdict::hangs
           : silent_ + starved_ > options_.starves ? Verdict::starves
                                                   : Verdict::lives;
  }
  /// The same with evidence from its processes, checked only after `suspicious`.
  Verdict update(bool beats, ProcessWatch& processes, double now) {
    return update(
        {beats, processes.ended(), silent() > options_.suspicious && processes.waitsForProcessor(now)}, now);
  }
  /// [s] since the last cycle
  double silent() const { return silent_ + starved_; }
  /// [s] of these caused by the overloaded computer
  double starved() const { return starved_; }

 private:
  LivenessOptions options_;
  double silent_ = 0.0, starved_ = 0.0, last_ = std::numeric_limits<double>::infinity();
};

}  // namespace smartmill::cnc::linuxcnc
