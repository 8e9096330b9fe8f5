#include "parameters_ros.h"

#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::cnc {

NodeParameters readParameters(ParameterReader& reader) {
  NodeParameters parameters;
  BridgeParameters& bridge = parameters.bridge;
  std::string model_file;
  std::array<std::vector<double>, 3> travel;
  reader.read("host", bridge.host);
  reader.read("port", bridge.port);
  reader.read("rate", parameters.rate);
  reader.read("reply_timeout", bridge.reply_timeout);
  reader.read("reconnect_period", bridge.reconnect_period);
  reader.read("spindle", bridge.spindle);
  reader.read("marker_macro", bridge.marker_macro);
  reader.read("orient_macro", bridge.orient_macro);
  reader.read("settle_time", bridge.settle_time);
  reader.read("condition_lead", bridge.condition_lead);
  reader.read("standstill_speed", bridge.standstill_speed);
  reader.read("stall_timeout", bridge.stall_timeout);
  reader.read("stop_timeout", bridge.stop_timeout);
  reader.read("open_timeout", bridge.open_timeout);
  reader.read("model", model_file);
  reader.read("travel_x", travel[0]);
  reader.read("travel_y", travel[1]);
  reader.read("travel_z", travel[2]);
  reader.read("max_feed", bridge.limits.max_feed);
  reader.read("max_spindle_speed", bridge.limits.max_spindle_speed);
  reader.read("max_dwell", bridge.limits.max_dwell);
  reader.finish();

  if (!(parameters.rate >= 1.0 && parameters.rate <= 200.0)) {
    throw Error("rate: " + std::to_string(parameters.rate) + " is not within 1 .. 200 Hz");
  }
  if (!model_file.empty()) {
    const MachineModel model = readMachineModel(model_file);
    if (model.axes) {
      for (std::size_t i = 0; i < 3; ++i) {
        if (travel[i].empty()) {
          travel[i] = {model.axes->travel[i][0], model.axes->travel[i][1]};
        }
      }
      if (bridge.limits.max_feed == 0.0) {
        bridge.limits.max_feed = model.axes->rapid;
      }
    }
    if (model.spindle && model.spindle->max_speed && bridge.limits.max_spindle_speed == 0.0) {
      bridge.limits.max_spindle_speed = *model.spindle->max_speed;
    }
  }
  const std::string or_model = " (or a model that has it)";
  for (std::size_t i = 0; i < 3; ++i) {
    if (travel[i].size() != 2) {
      throw Error(std::string("travel_") + "xyz"[i] + ": lowest and highest position [m] are due" + or_model);
    }
    bridge.limits.travel[i] = {travel[i][0], travel[i][1]};
  }
  if (bridge.limits.max_feed == 0.0) {
    throw Error("max_feed: a feed above 0 [m/s] is due" + or_model);
  }
  if (bridge.limits.max_spindle_speed == 0.0) {
    throw Error("max_spindle_speed: a speed above 0 [rad/s] is due" + or_model);
  }
  bridge.validate();
  return parameters;
}

}  // namespace smartmill::cnc
