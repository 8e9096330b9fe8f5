#pragma once

#include <algorithm>
#include <limits>

namespace smartmill::cnc::linuxcnc {

/// How long something has not happened, as far as the observer was awake himself: a look after a long pause
/// (a starved process, a computer that was halted) counts as one after a short pause.
class Stillness {
 public:
  static constexpr double LONGEST_STEP = 0.05;  ///< [s] that one look adds

  /// @param happened since the last look @param now [s] any steady time @return [s]
  double look(bool happened, double now) {
    still_ = happened ? 0.0 : still_ + std::clamp(now - last_, 0.0, LONGEST_STEP);
    last_ = now;
    return still_;
  }
  double still() const { return still_; }  ///< [s] at the last look

 private:
  double still_ = 0.0, last_ = std::numeric_limits<double>::infinity();
};

}  // namespace smartmill::cnc::linuxcnc
