#include "session/session_parameters.h"

#include <set>

#include "smartmill_core/error.h"

namespace smartmill::session {
namespace {

void directions(const char* key, const std::string& value, const std::string& allowed) {
  if (value.find_first_not_of(allowed) != std::string::npos || value.empty() ||
      std::set<char>(value.begin(), value.end()).size() != value.size()) {
    throw Error(std::string(key) + ": '" + value + "', expected letters of " + allowed +
                ", each at most once");
  }
}

}  // namespace

void SessionParameters::declare(ParameterTable& table) {
  const Range waiting_time = Range::closed(1e-3, 1e5);
  table.title(
      "Parameters of session_node (package smartmill_launch): the measuring session. SI units throughout.");
  table.atLaunch("model", model,
                 "path of a smartmill-model/1 file: tool, stickout, axes, workpiece and spindle limits");
  table.section();
  table.text("summary", summary, "JSON file for the summary, written at the end; empty: none");
  table.flag("verify", verify, "wait for the stability chart and verify it with two cuts");
  table.flag("use_stored", use_stored,
             "begin with the coefficients of the database: tests that they make unnecessary are not made, "
             "unless the others disagree with them");
  plan.declare(table);
  table.section("Hammer tests.");
  table.text("tool_directions", tool_directions, "directions of the tool's FRF");
  table.text("sensor_directions", sensor_directions, "directions of the taps on the force sensor");
  table.number("hits", hits, "1", Range::closed(1, 1000), "hits on the tool per direction");
  table.number("modes", modes, "1", Range::closed(0, 20),
               "modes to fit to the tool's FRF; 0: chosen by evidence");
  table.number("sensor_hits", sensor_hits, "1", Range::closed(1, 1000),
               "hits on the force sensor per direction");
  table.number("sensor_modes", sensor_modes, "1", Range::closed(0, 20),
               "modes to fit to the FRF of the force sensor; 0: chosen by evidence");
  calibration.declare(table);
  table.section("Start and time limits.");
  table.text("recorder", recorder,
             "recorder node; the session starts after the node has subscribed; empty: none");
  table.flag("resume", resume,
             "continue the interrupted session of this launch: measurements and cuts that are done are not "
             "repeated");
  table.number("start_delay", start_delay, "s", Range::closed(0.0, 60.0),
               "delay of the first goal, in which other subscribers connect");
  table.number("ready_timeout", ready_timeout, "s", waiting_time,
               "until nodes, sensors and controller are available");
  table.number("frf_timeout", frf_timeout, "s", waiting_time, "of the hammer test in one direction");
  table.number("program_timeout", program_timeout, "s", waiting_time, "of a program, beyond its own time");
  table.number("identify_timeout", identify_timeout, "s", waiting_time,
               "of the identification of the coefficients");
  table.number("chart_timeout", chart_timeout, "s", waiting_time, "until the stability chart is available");
}

PlanParameters SessionParameters::cuts() const {
  PlanParameters cuts = plan;
  if (calibration.kind() == ForceSensorKind::spindle) cuts.tuning_speeds = calibration.tuning_speeds;
  return cuts;
}

void SessionParameters::validate() const {
  checkBounds(*this);
  plan.validate();
  calibration.validate();
  if (model.empty()) throw Error("model: empty, expected the path of a smartmill-model/1 file");
  if (!plan.hammer && calibration.kind() != ForceSensorKind::table) {
    throw Error("hammer: false: sensor " + calibration.sensor +
                " is calibrated by taps, expected sensor table or a hammer");
  }
  if (plan.hammer && verify && tool_directions.size() < 2) {
    throw Error("verify: a stability chart requires the tool's FRF in x and y, tool_directions is '" +
                tool_directions + "'");
  }
  directions("tool_directions", tool_directions, "xy");
  directions("sensor_directions", sensor_directions, "xyz");
}

}  // namespace smartmill::session
