#pragma once

#include <algorithm>
#include <limits>

#include "smartmill_cnc/linuxcnc/liveness.h"

namespace smartmill::cnc::linuxcnc {

/// Time since an event last happened, excluding pauses of the observer (a starved process, a suspended
/// computer): every update adds at most LivenessOptions::longest_step.
class SilenceTimer {
 public:
  /// @param happened since the last update @param now [s] any steady time @return [s] since the last event
  double update(bool happened, double now) {
    silent_ = happened ? 0.0 : silent_ + std::clamp(now - last_, 0.0, LivenessOptions().longest_step);
    last_ = now;
    return silent_;
  }
  double silent() const { return silent_; }  ///< [s] as of the last update

 private:
  double silent_ = 0.0, last_ = std::numeric_limits<double>::infinity();
};

}  // namespace smartmill::cnc::linuxcnc
