#include "session_parameters.h"

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
void within(const char* key, double value, double low, double high) {
  if (value >= low && value <= high) return;
  throw Error(std::string(key) + ": " + std::to_string(value) + " is out of range");
}

}  // namespace

void SessionParameters::validate() const {
  plan.validate();
  if (model.empty()) throw Error("model: the path of a smartmill-model/1 file is due");
  if (verify && tool_directions.size() < 2) {
    throw Error("verify: a chart needs the tool's FRF in x and y, tool_directions is '" + tool_directions +
                "'");
  }
  directions("tool_directions", tool_directions, "xy");
  directions("sensor_directions", sensor_directions, "xyz");
  within("hits", hits, 1, 1000);
  within("sensor_hits", sensor_hits, 1, 1000);
  within("modes", modes, 0, 20);
  within("sensor_modes", sensor_modes, 0, 20);
  within("start_delay", start_delay, 0.0, 60.0);
  constexpr double LEAST = 1e-3, MOST = 1e5;  // [s]
  within("ready_timeout", ready_timeout, LEAST, MOST);
  within("frf_timeout", frf_timeout, LEAST, MOST);
  within("program_timeout", program_timeout, LEAST, MOST);
  within("identify_timeout", identify_timeout, LEAST, MOST);
  within("chart_timeout", chart_timeout, LEAST, MOST);
}

SessionParameters readParameters(ParameterReader& reader) {
  SessionParameters parameters;
  PlanParameters& plan = parameters.plan;
  reader.read("tool", plan.tool);
  reader.read("material", plan.material);
  reader.read("air_speeds", plan.air_speeds);
  reader.read("air_time", plan.air_time);
  reader.read("slot_speed", plan.slot_speed);
  reader.read("slot_depth", plan.slot_depth);
  reader.read("slot_feeds", plan.slot_feeds);
  reader.read("slot_time", plan.slot_time);
  reader.read("least_slot_time", plan.least_slot_time);
  reader.read("stable_time", plan.stable_time);
  reader.read("unstable_time", plan.unstable_time);
  reader.read("least_revolutions", plan.least_revolutions);
  reader.read("resonance_speed", plan.resonance_speed);
  reader.read("resonance_depth", plan.resonance_depth);
  reader.read("resonance_feed", plan.resonance_feed);
  reader.read("resonance_time", plan.resonance_time);
  reader.read("lane_margin", plan.lane_margin);
  reader.read("clearance", plan.clearance);
  reader.read("safe_height", plan.safe_height);
  reader.read("plunge_feed", plan.plunge_feed);
  reader.read("spin_up_time", plan.spin_up_time);
  reader.read("model", parameters.model);
  reader.read("summary", parameters.summary);
  reader.read("tool_directions", parameters.tool_directions);
  reader.read("sensor_directions", parameters.sensor_directions);
  reader.read("hits", parameters.hits);
  reader.read("modes", parameters.modes);
  reader.read("sensor_hits", parameters.sensor_hits);
  reader.read("sensor_modes", parameters.sensor_modes);
  reader.read("verify", parameters.verify);
  reader.read("start_delay", parameters.start_delay);
  reader.read("ready_timeout", parameters.ready_timeout);
  reader.read("frf_timeout", parameters.frf_timeout);
  reader.read("program_timeout", parameters.program_timeout);
  reader.read("identify_timeout", parameters.identify_timeout);
  reader.read("chart_timeout", parameters.chart_timeout);
  reader.finish();
  parameters.validate();
  return parameters;
}

}  // namespace smartmill::session
