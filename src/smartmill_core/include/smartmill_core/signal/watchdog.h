#pragma once

namespace smartmill {

/// Tells when a source has fallen silent. Time comes in as an argument: wall time, for the stamps of a
/// recording stand still when it ends.
class Watchdog {
 public:
  /// @param timeout [s] of silence after which the source counts as dead @param now [s]
  Watchdog(double timeout, double now) : timeout_(timeout), last_(now) {}

  void heard(double now) {
    last_ = now;
    ever_ = true;
    ended_ = false;
  }

  bool ever() const { return ever_; }                      ///< anything heard yet?
  double silent(double now) const { return now - last_; }  ///< [s] since the last, or since the start
  bool dead(double now) const { return silent(now) > timeout_; }
  double timeout() const { return timeout_; }  ///< [s]

  /// True once after each end of what was heard: nothing more will come to release what waits.
  bool ended(double now) {
    if (ended_ || !ever_ || !dead(now)) return false;
    return ended_ = true;
  }

 private:
  double timeout_, last_;
  bool ever_ = false, ended_ = false;
};

}  // namespace smartmill
