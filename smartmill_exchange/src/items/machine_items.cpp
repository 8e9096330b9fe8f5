// Data items of the machine and its controller.
#include <algorithm>
#include <cmath>

#include "items/declarations.h"
#include "smartmill_core/names.h"
#include "smartmill_core/units.h"

namespace smartmill::exchange {
namespace {

constexpr double PERCENT = 100.0, ZERO_CELSIUS = 273.15;  // [1/1], [K]
constexpr double SAME_ANGLE = 1e-3;  // [rad] of the engagement of a chart and of the running cut
constexpr const char* EXACT = "none: as the controller reports it";
constexpr const char* POLLED = "half the polling rate of the controller (`cnc.yaml`)";
constexpr const char* AT_CHANGE = "at each change";

using State = plain::CncState;

/// The value only while the controller answers.
template <class Get>
std::function<Value(const State&, const Picture&)> connected(Get get) {
  return [get](const State& s, const Picture& picture) {
    return s.connected ? Value(get(s, picture)) : Value(Unavailable{});
  };
}

Value executionOf(const State& s) {
  switch (s.run) {
    case State::RUN_RESET:
      return Text{"READY"};
    case State::RUN_STOP:
      return Text{"INTERRUPTED"};
    case State::RUN_HOLD:
      return Text{"FEED_HOLD"};
    case State::RUN_START:
      return Text{"ACTIVE"};
    default:
      return Unavailable{};
  }
}

Value modeOf(const State& s) {
  switch (s.mode) {
    case State::MODE_MDI:
      return Text{"MANUAL_DATA_INPUT"};
    case State::MODE_MEM:
    case State::MODE_DNC:
      return Text{"AUTOMATIC"};
    case State::MODE_EDIT:
      return Text{"EDIT"};
    case State::MODE_HANDLE:
    case State::MODE_JOG:
    case State::MODE_INC:
    case State::MODE_REFERENCE:
      return Text{"MANUAL"};
    default:
      return Unavailable{};
  }
}

/// The value of the axis whose name begins with a letter (X, X1, X_axis).
Value ofAxis(const std::vector<std::string>& axes, const std::vector<double>& values, char letter,
             double scale) {
  for (std::size_t i = 0; i < std::min(axes.size(), values.size()); ++i)
    if (!axes[i].empty() && std::toupper(static_cast<unsigned char>(axes[i].front())) == letter)
      return numberOrNone(scale * values[i]);
  return Unavailable{};
}

/// [m] Depth limit of the chart at the speed of the spindle; NaN: no chart of this cut, or no limit found.
double depthLimit(const State& s, const Picture& picture) {
  if (!picture.chart || !picture.condition) return NOT_A_NUMBER;
  const plain::StabilityChart& chart = *picture.chart;
  const plain::CuttingCondition& cut = *picture.condition;
  const bool same = cut.kind == plain::CuttingCondition::CUT && chart.tool == cut.tool &&
                    chart.material == cut.material &&
                    std::abs(chart.entry_angle - cut.entry_angle) < SAME_ANGLE &&
                    std::abs(chart.exit_angle - cut.exit_angle) < SAME_ANGLE;
  const std::vector<double>& speed = chart.spindle_speed;
  if (!same || speed.size() != chart.depth_limit.size() || speed.empty() || s.spindle_speed < speed.front() ||
      s.spindle_speed > speed.back())
    return NOT_A_NUMBER;
  const auto after = std::lower_bound(speed.begin(), speed.end(), s.spindle_speed);
  const auto k = static_cast<std::size_t>(after - speed.begin());
  if (k == 0) return chart.depth_limit[0];
  const double share = (s.spindle_speed - speed[k - 1]) / (speed[k] - speed[k - 1]);
  return chart.depth_limit[k - 1] + share * (chart.depth_limit[k] - chart.depth_limit[k - 1]);
}

Value marginOf(const State& s, const Picture& picture) {
  const double limit = depthLimit(s, picture);
  return numberOrNone(std::isnan(limit) ? limit : PERCENT * (limit / picture.condition->axial_depth - 1.0));
}

Value frictionOf(const State& s, const Picture& picture) {
  if (!picture.coefficients) return Unavailable{};
  const plain::CuttingCoefficients& c = *picture.coefficients;
  return numberOrNone(c.friction_coulomb + c.friction_viscous * std::abs(s.spindle_speed));
}

Declared<State> axisPosition(const std::string& letter) {
  const std::string axis(1, static_cast<char>(std::tolower(static_cast<unsigned char>(letter.front()))));
  return {{axis + "_position", "c_" + axis, Category::sample, "POSITION", "ACTUAL", "", "MILLIMETER", false,
           "position of axis " + letter + " in machine coordinates", EXACT, POLLED},
          connected([letter](const State& s, const Picture&) {
            return ofAxis(s.axes, s.position, letter.front(), 1.0 / units::MM);
          })};
}

Declared<plain::LoadSample> axisLoad(const std::string& letter) {
  const std::string axis(1, static_cast<char>(std::tolower(static_cast<unsigned char>(letter.front()))));
  return {{axis + "_load", "c_" + axis, Category::sample, "LOAD", "", "", "PERCENT", false,
           "load of the drive of axis " + letter + ", 100: its rated load",
           "resolution of the load meter, 1 % at most controllers", POLLED},
          [letter](const plain::LoadSample& m, const Picture&) {
            return ofAxis(m.axes, m.axis_load, letter.front(), PERCENT);
          }};
}

}  // namespace

const std::vector<Component>& components() {
  static const std::vector<Component> LIST{{"c_axes", "", "Axes", "axes"},
                                           {"c_x", "c_axes", "Linear", "X"},
                                           {"c_y", "c_axes", "Linear", "Y"},
                                           {"c_z", "c_axes", "Linear", "Z"},
                                           {"c_spindle", "c_axes", "Rotary", "S"},
                                           {"c_controller", "", "Controller", "controller"},
                                           {"c_path", "c_controller", "Path", "path"},
                                           {"c_auxiliaries", "", "Auxiliaries", "auxiliaries"},
                                           {"c_force", "c_auxiliaries", "Sensor", "force"}};
  return LIST;
}

ItemsOf<State> stateItems() {
  return {
      names::CNC_STATE,
      true,
      {{{"availability", "", Category::event, "AVAILABILITY", "", "", "", false,
         "AVAILABLE while the controller answers", "none", AT_CHANGE},
        [](const State& s, const Picture&) {
          return s.connected ? Value(Text{"AVAILABLE"}) : Value(Unavailable{});
        }},
       {{"connection", "c_controller", Category::condition, "COMMUNICATIONS", "", "", "", false,
         "fault while the controller does not answer", "none", AT_CHANGE},
        [](const State& s, const Picture&) {
          return s.connected ? Activations{}
                             : Activations{{true, "NOT_CONNECTED", "the controller does not answer"}};
        }},
       {{"emergency_stop", "c_controller", Category::event, "EMERGENCY_STOP", "", "", "", false,
         "ARMED: released, TRIGGERED: pressed", EXACT, AT_CHANGE},
        connected([](const State& s, const Picture&) { return Text{s.emergency ? "TRIGGERED" : "ARMED"}; })},
       {{"mode", "c_controller", Category::event, "CONTROLLER_MODE", "", "", "", false,
         "MEM and DNC: AUTOMATIC; HANDLE, JOG, INC and REFERENCE: MANUAL", EXACT, AT_CHANGE},
        connected([](const State& s, const Picture&) { return modeOf(s); })},
       {{"execution", "c_path", Category::event, "EXECUTION", "", "", "", false,
         "reset: READY, stopped at the end of a block: INTERRUPTED, FEED_HOLD, running: ACTIVE", EXACT,
         AT_CHANGE},
        connected([](const State& s, const Picture&) { return executionOf(s); })},
       {{"program", "c_path", Category::event, "PROGRAM", "", "", "", false, "number of the running program",
         EXACT, AT_CHANGE},
        connected([](const State& s, const Picture&) { return Text{std::to_string(s.program)}; })},
       {{"line", "c_path", Category::event, "LINE_LABEL", "", "", "", false, "N word of the running block",
         EXACT, AT_CHANGE},
        connected([](const State& s, const Picture&) { return Text{std::to_string(s.sequence)}; })},
       {{"feed", "c_path", Category::sample, "PATH_FEEDRATE", "ACTUAL", "", "MILLIMETER/SECOND", false,
         "feed along the path", EXACT, POLLED},
        connected([](const State& s, const Picture&) { return numberOrNone(s.feed / units::MM); })},
       axisPosition("X"),
       axisPosition("Y"),
       axisPosition("Z"),
       {{"spindle_speed", "c_spindle", Category::sample, "ROTARY_VELOCITY", "ACTUAL", "", "REVOLUTION/MINUTE",
         false, "speed of the spindle", EXACT, POLLED},
        connected([](const State& s, const Picture&) {
          return numberOrNone(units::rpmFromRadPerSec(s.spindle_speed));
        })},
       {{"spindle_friction", "c_spindle", Category::sample, "TORQUE", "", "", "NEWTON_METER", false,
         "friction of the spindle at its speed, from the air cuts of the last identification",
         "none stated by the identification", "constant between identifications"},
        connected([](const State& s, const Picture& picture) { return frictionOf(s, picture); })},
       {{"depth_limit", "c_path", Category::sample, "s:DEPTH_LIMIT", "", "", "MILLIMETER", false,
         "axial depth at which the running cut begins to chatter at its speed, by the chart of its tool, "
         "material and engagement",
         "not propagated; `chatter-probability` computes it", POLLED},
        connected([](const State& s, const Picture& picture) {
          return numberOrNone(depthLimit(s, picture) / units::MM);
        })},
       {{"stability_margin", "c_path", Category::sample, "s:STABILITY_MARGIN", "", "", "PERCENT", false,
         "depth_limit over the axial depth of the running cut, minus 1; negative: it should chatter",
         "as depth_limit", POLLED},
        connected([](const State& s, const Picture& picture) { return marginOf(s, picture); })}}};
}

ItemsOf<plain::CncAlarms> alarmItems() {
  return {names::CNC_ALARMS,
          false,
          {{{"alarms", "c_controller", Category::condition, "SYSTEM", "", "", "", false,
             "alarms of the controller, by number", EXACT, AT_CHANGE},
            [](const plain::CncAlarms& m, const Picture&) {
              Activations active;
              for (const plain::CncAlarm& alarm : m.alarms) {
                std::string code = std::to_string(alarm.number);
                if (alarm.axis > 0) code += "." + std::to_string(alarm.axis);
                active.push_back({true, code, alarm.text});
              }
              return active;
            }}}};
}

ItemsOf<plain::LoadSample> loadItems() {
  return {
      names::CNC_LOAD,
      true,
      {{{"spindle_load", "c_spindle", Category::sample, "LOAD", "", "", "PERCENT", false,
         "load of the spindle, 100: full scale of the load meter",
         "resolution of the load meter, 1 % at most controllers", POLLED},
        [](const plain::LoadSample& m, const Picture&) { return numberOrNone(PERCENT * m.spindle_load); }},
       axisLoad("X"),
       axisLoad("Y"),
       axisLoad("Z")}};
}

ItemsOf<plain::MachineTemperature> temperatureItems() {
  return {names::MACHINE_TEMPERATURE,
          false,
          {{{"spindle_temperature", "c_spindle", Category::sample, "TEMPERATURE", "", "", "CELSIUS", false,
             "temperature of the spindle motor", EXACT, "period `temperature_period` of `cnc.yaml`"},
            [](const plain::MachineTemperature& m, const Picture&) {
              return numberOrNone(m.spindle_motor - ZERO_CELSIUS);
            }}}};
}

ItemsOf<plain::SpindleHealth> healthItems() {
  return {names::SPINDLE_HEALTH,
          false,
          {{{"spindle_health", "c_spindle", Category::condition, "HARDWARE", "", "", "", false,
             "warning for each quantity of the spindle (mode, friction, unbalance) that has drifted since "
             "its first measurement",
             "in the text, in standard deviations", "at each measurement"},
            [](const plain::SpindleHealth& m, const Picture&) {
              Activations active;
              for (const plain::HealthChange& change : m.changes)
                if (change.drifted)
                  active.push_back({false, change.quantity,
                                    m.measured + ": " + change.quantity + " was " + numberText(change.first) +
                                        ", is " + numberText(change.now) + ", " +
                                        numberText(change.deviations) + " standard deviations"});
              return active;
            }}}};
}

}  // namespace smartmill::exchange
