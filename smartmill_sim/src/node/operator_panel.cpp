#include "node/operator_panel.h"

#include <array>
#include <utility>

#include <boost/function.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"

namespace smartmill::sim {

void OperatorPanel::advertise(const std::string& key, std::size_t values, Press press) {
  using Response = smartmill_msgs::PanelKey::Response;
  const boost::function<bool(Request&, Response&)> answer = [key, values, press = std::move(press)](
                                                                const Request& request, Response& response) {
    response.message = request.values.size() == values ? press(request)
                                                       : std::to_string(request.values.size()) +
                                                             " values, expected " + std::to_string(values);
    response.code = response.message.empty() ? Response::OK : Response::REFUSED;
    response.message = key + ": " + (response.message.empty() ? "done" : response.message);
    return true;
  };
  keys_.push_back(nh_.advertiseService("sim/panel/" + key, answer));
}

void OperatorPanel::advertiseKeys(Controller& controller) {
  advertise("mode", 1, [&controller](const Request& request) -> std::string {
    const int mode = static_cast<int>(request.values[0]);
    if (mode != request.values[0] || mode < focas::AUT_MDI || mode > focas::AUT_REMOTE) {
      return "expected one of MODE_* of CncState";
    }
    controller.setMode(mode);
    return {};
  });
  advertise("emergency_stop", 1, [&controller](const Request& request) -> std::string {
    controller.emergency(request.values[0] != 0.0);
    return {};
  });
  advertise("reset", 0, [&controller](const Request&) -> std::string {
    controller.calls().programs.reset();
    return {};
  });
  advertise("feed_hold", 0, [&controller](const Request&) -> std::string {
    controller.feedHold();
    return {};
  });
  advertise("program", 1, [&controller](const Request& request) -> std::string {
    focas::ProgramsInterface& programs = controller.calls().programs;
    focas::EwCode code = programs.storePrograms(request.text);
    if (code == focas::EW_OK) code = programs.selectProgram(static_cast<int>(request.values[0]));
    return code == focas::EW_OK ? std::string() : focas::ewName(code);
  });
  advertise("cycle_start", 0, [&controller](const Request&) -> std::string {
    const focas::EwCode code = controller.calls().programs.cycleStart();
    return code == focas::EW_OK ? std::string() : focas::ewName(code);
  });
  advertise("overrides", 3, [&controller](const Request& request) -> std::string {
    controller.setOverrides(request.values[0], request.values[1], request.values[2]);
    return {};
  });
  advertise("alarm", 1, [&controller](const Request& request) -> std::string {
    controller.raiseAlarm(static_cast<int>(request.values[0]), request.text);
    return {};
  });
}

void OperatorPanel::advertiseManualActions(World& world, const WorldOptions& options) {
  const auto triple = [](const Request& r) {
    return std::array<double, 3>{r.values[0], r.values[1], r.values[2]};
  };
  using Action = smartmill_msgs::OperatorAction::Request;
  const auto vector = [](const geometry_msgs::Vector3& v) { return std::array<double, 3>{v.x, v.y, v.z}; };
  if (options.spindle_sensor.present) {
    actions_[Action::HANG_WEIGHT] = [&world, vector](const Action& a) { world.pull(vector(a.load), false); };
    actions_[Action::PRESS_WORKPIECE] = [&world, vector](const Action& a) {
      world.pull(vector(a.load), true);
    };
    actions_[Action::CHANGE_TOOL] = [&world](const Action& a) { world.setToolLength(a.length); };
    advertise("hang_weight", 3, [&world, triple](const Request& request) -> std::string {
      world.pull(triple(request), false);
      return {};
    });
    advertise("press_workpiece", 3, [&world, triple](const Request& request) -> std::string {
      world.pull(triple(request), true);
      return {};
    });
    advertise("tool_length", 1, [&world](const Request& request) -> std::string {
      try {
        world.setToolLength(request.values[0]);
      } catch (const Error& e) {
        return e.what();
      }
      return {};
    });
  }
  advertise("new_workpiece", 0, [&world](const Request&) -> std::string {
    try {
      world.changeWorkpiece();
    } catch (const Error& e) {
      return e.what();
    }
    return {};
  });
  if (options.plate.present) {
    actions_[Action::TAP_POINT] = [&world, vector](const Action& a) { world.setTapPoint(vector(a.point)); };
    advertise("tap_point", 3, [&world, triple](const Request& request) -> std::string {
      world.setTapPoint(triple(request));
      return {};
    });
  }
  if (actions_.empty()) return;
  keys_.push_back(nh_.advertiseService(
      names::OPERATOR_ACTION,
      boost::function<bool(Action&, smartmill_msgs::OperatorAction::Response&)>(
          [this](const Action& request, auto& response) { return act(request, response); })));
}

bool OperatorPanel::act(const smartmill_msgs::OperatorAction::Request& request,
                        smartmill_msgs::OperatorAction::Response& response) {
  const auto action = actions_.find(request.action);
  try {
    if (action == actions_.end()) throw Error("nothing to do this with on this machine");
    action->second(request);
    response.message = "done: " + request.text;
  } catch (const Error& e) {
    response.code = smartmill_msgs::OperatorAction::Response::REFUSED;
    response.message = request.text + ": " + e.what();
  }
  return true;
}

}  // namespace smartmill::sim
