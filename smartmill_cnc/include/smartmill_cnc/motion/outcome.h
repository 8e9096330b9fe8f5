#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "smartmill_cnc/controller/controller.h"

namespace smartmill::cnc {

/// Codes of the actions RunProgram, Jog, OrientSpindle.
enum class MotionCode : std::uint8_t {
  ok = 0,
  cancelled = 1,
  not_connected = 2,
  not_armed = 3,
  wrong_mode = 4,
  limit = 5,
  alarm = 6,
  lost = 7,
  busy = 8,
  bad_goal = 9
};
/// Code of a motion that a failure of the controller ends. @param otherwise of a failure other than an alarm
MotionCode codeOf(const Failure& failure, MotionCode otherwise);

/// Codes of the service SetOverrides.
enum class OverrideCode : std::uint8_t { ok = 0, not_connected = 1, not_armed = 2, limit = 3, refused = 4 };
/// Codes of the service FeedHold.
enum class HoldCode : std::uint8_t { ok = 0, not_connected = 1, not_armed = 2, refused = 3 };
/// Codes of the service ArmMotion.
enum class ArmCode : std::uint8_t { ok = 0, not_connected = 1, wrong_mode = 2, alarm = 3, held = 4 };
/// Codes of the service SetMacro.
enum class MacroCode : std::uint8_t { ok = 0, not_connected = 1, refused = 2 };

template <class Code>
struct Answer {
  Code code = Code::ok;
  std::string message;  ///< one line
};
using Outcome = Answer<MotionCode>;

struct OverrideAnswer : Answer<OverrideCode> {
  Overrides taken;  ///< valid with OverrideCode::ok
};

struct Progress {
  std::size_t bytes_sent = 0, bytes_total = 0;
  std::string stage;            ///< opening, sending, running, stopping; empty when idle
  double distance_to_go = 0.0;  ///< [m] of the jogged axis
};

}  // namespace smartmill::cnc
