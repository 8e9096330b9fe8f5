#pragma once

#include <algorithm>
#include <limits>

namespace smartmill::cnc::linuxcnc {

/// How long something has not happened, as far as the observer was awake himself: a update after a long pause
/// (a starved process, a computer that was halted) counts as one after a short pause.
class SilenceTimer {
 public:
  static constexpr double LONGEST_STEP = 0.05;  ///< [s] that one update adds

  /// @param happened since the last update @param now [s] any steady time @return [s]
  double update(bool happened, double now) {
    silent_ = happened ? 0.0 : silent_ + std::clamp(now - last_, 0.0, LONGEST_STEP);
    last_ = now;
    return silent_;
  }
  double silent() const { return silent_; }  ///< [s] at the last update

 private:
  double silent_ = 0.0, last_ = std::numeric_limits<double>::infinity();
};

}  // namespace smartmill::cnc::linuxcnc
