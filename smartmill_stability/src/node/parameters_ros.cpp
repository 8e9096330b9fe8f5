#include "node/parameters_ros.h"

#include "smartmill_core/error.h"

namespace smartmill::stability {

NodeParameters readParameters(ParameterReader& reader, const std::string& model) {
  NodeParameters parameters;
  ChartParameters& chart = parameters.chart;
  reader.read("entry_angle", chart.entry);
  reader.read("exit_angle", chart.exit);
  reader.read("feed_per_tooth", chart.feed_per_tooth);
  reader.read("kr", chart.kr);
  reader.read("speed_low", chart.speed_low);
  reader.read("speed_high", chart.speed_high);
  reader.read("speeds", chart.speeds);
  reader.read("frequency_low", chart.frequency_low);
  reader.read("frequency_high", chart.frequency_high);
  reader.read("line_error", chart.line_error);
  reader.read("method", chart.method);
  reader.read("modes_error", chart.modes_error);
  reader.read("use_modes", chart.use_modes);
  reader.read("max_depth", chart.max_depth);
  reader.read("depth_margin", chart.depth_margin);
  reader.read("speed_margin", chart.speed_margin);
  reader.read("load_share", chart.load_share);
  reader.read("recommended", chart.recommended);
  reader.read("unstable_factor", chart.unstable_factor);
  reader.read("unstable", chart.unstable);
  ChatterParameters& chatter = parameters.chatter;
  reader.read("chatter_revolutions", chatter.revolutions);
  reader.read("chatter_hop_revolutions", chatter.hop_revolutions);
  reader.read("chatter_energy_ratio", chatter.energy_ratio);
  reader.read("chatter_least_severity", chatter.least_severity);
  reader.read("chatter_alternation_ratio", chatter.alternation_ratio);
  reader.read("chatter_signal", parameters.chatter_signal);
  reader.read("path_tolerance", chatter.path_tolerance);
  reader.read("settle_revolutions", chatter.settle_revolutions);
  reader.read("maximum_gap", chatter.maximum_gap);
  reader.read("model", parameters.model);
  reader.read("hold_back", parameters.hold_back);
  reader.read("input_timeout", parameters.input_timeout);
  reader.finish();
  if (!model.empty()) parameters.model = model;
  chart.validate();
  chatter.validate();
  if (parameters.chatter_signal != "force" && parameters.chatter_signal != "vibration" &&
      parameters.chatter_signal != "sound")
    throw Error("chatter_signal: '" + parameters.chatter_signal + "' is unknown (force, vibration or sound)");
  if (parameters.model.empty()) throw Error("model: the path of a smartmill-model/1 file is due");
  if (!(parameters.hold_back >= 0.0)) throw Error("hold_back: at least 0 s is due");
  if (!(parameters.input_timeout > 0.0)) throw Error("input_timeout: above 0 s is due");
  return parameters;
}

}  // namespace smartmill::stability
