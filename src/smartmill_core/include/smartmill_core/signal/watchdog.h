#pragma once

#include <limits>

namespace smartmill {

/// Tells when a source has fallen silent. Silence is counted in ticks of whoever reads the source, not on a
/// clock: a reader that was starved finds what waits for it before its next tick, and does not take its own
/// delay for silence.
class Watchdog {
 public:
  /// @param timeout [s] of silence after which the source counts as dead
  explicit Watchdog(double timeout) : timeout_(timeout) {}

  void heard() {
    silent_ = 0.0;
    ever_ = true;
    ended_ = false;
  }
  /// Everything that waited was read; so much time has passed since the last tick. @param period [s]
  void tick(double period) { silent_ += period; }
  /// Who feeds the source says that nothing more will come.
  void end() { silent_ = std::numeric_limits<double>::infinity(); }

  bool ever() const { return ever_; }        ///< anything heard yet?
  double silent() const { return silent_; }  ///< [s] since the last, or since the start
  bool dead() const { return silent_ > timeout_; }

  /// True once after each end of what was heard: nothing more will come to release what waits.
  bool ended() {
    if (ended_ || !ever_ || !dead()) return false;
    return ended_ = true;
  }

 private:
  double timeout_, silent_ = 0.0;
  bool ever_ = false, ended_ = false;
};

}  // namespace smartmill
