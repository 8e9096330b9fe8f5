#include "smartmill_cnc/motion/observation.h"

#include "smartmill_core/axis_names.h"

namespace smartmill::cnc {

double Observation::clockJump(double next, double longest_step) const {
  const double jump = next - now;
  return jump >= 0.0 && (jump <= longest_step || !reading) ? 0.0 : jump;
}

std::optional<std::size_t> Observation::axisIndex(int axis) const {
  if (!reading) {
    return std::nullopt;
  }
  return controllerAxis(state().axes, static_cast<std::size_t>(axis));
}

std::string Observation::alarmText() const {
  return (state().emergency ? "emergency stop" : "alarm") +
         (state().alarm_text.empty() ? std::string() : ": " + state().alarm_text);
}

std::string Observation::modeText() const {
  return "the controller is not in DNC mode at its panel (mode " +
         std::to_string(static_cast<int>(state().mode)) + ")";
}

std::string Observation::textOf(const Failure& failure) const {
  return failure.kind == Failure::Kind::wrong_mode ? modeText() : failure.message;
}

}  // namespace smartmill::cnc
