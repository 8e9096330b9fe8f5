#include "session/session_parameters.h"

#include <set>

#include "smartmill_core/error.h"

namespace smartmill::session {
namespace {

void directions(const char* key, const std::string& value, const std::string& allowed) {
  if (value.find_first_not_of(allowed) != std::string::npos || value.empty() ||
      std::set<char>(value.begin(), value.end()).size() != value.size()) {
    throw Error(std::string(key) + ": '" + value + "', letters of " + allowed + " are due, each once");
  }
}

}  // namespace

void SessionParameters::declare(ParameterTable& table) {
  const Range patience = Range::closed(1e-3, 1e5);
  table.title(
      "Parameters of session_node (package smartmill_launch): the whole job, in order. SI units throughout.");
  table.atLaunch("model", model,
                 "path of a smartmill-model/1 file: tool, stickout, axes, workpiece and spindle limits");
  table.section();
  table.text("summary", summary, "JSON file that the session writes at its end; empty: none");
  table.flag("verify", verify, "wait for the stability chart and check it with two cuts");
  plan.declare(table);
  table.section("Hammer tests.");
  table.text("tool_directions", tool_directions, "of the tool's FRF");
  table.text("sensor_directions", sensor_directions, "of the force sensor's taps");
  table.number("hits", hits, "1", Range::closed(1, 1000), "on the tool, a direction");
  table.number("modes", modes, "1", Range::closed(0, 20), "of the tool to fit; 0: chosen by evidence");
  table.number("sensor_hits", sensor_hits, "1", Range::closed(1, 1000), "on the force sensor, a direction");
  table.number("sensor_modes", sensor_modes, "1", Range::closed(0, 20),
               "of the force sensor to fit; 0: chosen by evidence");
  table.section("Patience.");
  table.text("recorder", recorder, "node that records: nothing begins before it listens; empty: none");
  table.number("start_delay", start_delay, "s", Range::closed(0.0, 60.0),
               "before the first goal: listeners of any kind find the topics");
  table.number("ready_timeout", ready_timeout, "s", patience,
               "for nodes, sensors and controller to be there");
  table.number("frf_timeout", frf_timeout, "s", patience, "of one direction");
  table.number("program_timeout", program_timeout, "s", patience, "beyond a program's own time");
  table.number("identify_timeout", identify_timeout, "s", patience, "of the coefficients");
  table.number("chart_timeout", chart_timeout, "s", patience, "of the chart");
}

void SessionParameters::validate() const {
  checkBounds(*this);
  plan.validate();
  if (model.empty()) throw Error("model: the path of a smartmill-model/1 file is due");
  if (verify && tool_directions.size() < 2) {
    throw Error("verify: a chart needs the tool's FRF in x and y, tool_directions is '" + tool_directions +
                "'");
  }
  directions("tool_directions", tool_directions, "xy");
  directions("sensor_directions", sensor_directions, "xyz");
}

}  // namespace smartmill::session
