#pragma once

#include <optional>

#include "smartmill_focas/server.h"
#include "smartmill_sim/controller/motion_state.h"

namespace smartmill::sim {

/// Supervision of a moving machine: a fault raises an alarm, which stops it.
class MotionWatch {
 public:
  virtual ~MotionWatch() = default;
  /// The alarm of a state of motion; nullopt: none.
  virtual std::optional<focas::AlarmMessage> check(const MotionState& state) const = 0;
};

}  // namespace smartmill::sim
