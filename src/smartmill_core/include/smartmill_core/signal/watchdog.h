#pragma once

#include <limits>

namespace smartmill {

/// Detects that a source has fallen silent. Silence is counted in ticks of the reader, not on a clock: a
/// starved reader first processes its backlog before its next tick, and does not mistake its own delay for
/// silence.
class Watchdog {
 public:
  /// @param timeout [s] of silence after which the source counts as dead
  explicit Watchdog(double timeout) : timeout_(timeout) {}

  void heard() {
    silent_ = 0.0;
    ever_ = true;
    ended_ = false;
  }
  /// Call after the backlog was read. @param period [s] since the last tick
  void tick(double period) { silent_ += period; }
  /// The producer reports the end of the source.
  void end() { silent_ = std::numeric_limits<double>::infinity(); }

  bool ever() const { return ever_; }        ///< whether anything was received
  double silent() const { return silent_; }  ///< [s] since the last message, or since the start
  bool dead() const { return silent_ > timeout_; }

  /// True once after each end of a source that had sent data: no later message will release waiting items.
  bool ended() {
    if (ended_ || !ever_ || !dead()) return false;
    return ended_ = true;
  }

 private:
  double timeout_, silent_ = 0.0;
  bool ever_ = false, ended_ = false;
};

}  // namespace smartmill
