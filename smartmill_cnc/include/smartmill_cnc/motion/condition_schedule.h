#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "smartmill_core/signal/streams.h"

namespace smartmill::cnc {

/// Announces the cutting condition of a motion before it begins and before it ends, so that every subscriber
/// has it in time. Times [s] are those of the caller's clock.
class ConditionSchedule {
 public:
  /// @param lead [s] from the announcement to the begin or the end
  explicit ConditionSchedule(double lead) : lead_(lead) {}

  /// @param condition nullopt: of a motion without one, which begins at once
  void announce(const std::optional<CuttingCondition>& condition, double now);
  void announceEnd(double now);
  /// The motion has ended; ends a condition whose end is not announced.
  void breakOff(double now);
  bool hasBegun(double now) const { return now >= from_; }
  bool hasEnded(double now) const { return now >= to_; }  ///< after announceEnd()
  /// The condition whose end is not announced.
  const std::optional<CuttingCondition>& running() const { return running_; }

  /// Announcements since the last call, with the stamps of begin or end.
  std::vector<CuttingCondition> take() { return std::exchange(announced_, {}); }
  void shift(double jump) {
    from_ += jump;
    to_ += jump;
  }

 private:
  void end(double stamp);

  double lead_;
  std::optional<CuttingCondition> running_;
  std::vector<CuttingCondition> announced_;
  double from_ = 0.0, to_ = 0.0;  // [s]
};

}  // namespace smartmill::cnc
