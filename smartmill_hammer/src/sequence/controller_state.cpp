#include "controller_state.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "smartmill_core/axis_names.h"

namespace smartmill::hammer {

std::optional<AxesPosition> axesPosition(const CncState& state) {
  AxesPosition result;
  bool found[3] = {false, false, false};
  for (std::size_t i = 0; i < state.axes.size() && i < state.position.size(); ++i) {
    std::string name = state.axes[i];
    for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    const std::optional<std::size_t> axis = axisIndex(name);
    if (!axis) continue;
    result.position[*axis] = state.position[i];
    found[*axis] = true;
    if (i < state.distance_to_go.size())
      result.to_go = std::max(result.to_go, std::abs(state.distance_to_go[i]));
  }
  if (!(found[0] && found[1] && found[2])) return std::nullopt;
  return result;
}

std::string motionFault(const CncState& state) {
  if (!state.connected) return "the connection to the controller is lost";
  if (state.emergency) return "emergency stop";
  if (state.alarm) return "alarm" + (state.alarm_text.empty() ? std::string() : " " + state.alarm_text);
  if (!state.armed) return "motion is not armed";
  return {};
}

}  // namespace smartmill::hammer
