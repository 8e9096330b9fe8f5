#include "node/parameters_ros.h"

#include <string>
#include <vector>

#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"

namespace smartmill::cnc {

NodeParameters readParameters(ParameterReader& reader) {
  NodeParameters parameters;
  FocasParameters& controller = parameters.controller;
  MotionParameters& motion = parameters.motion;
  std::string model_file;
  std::array<std::vector<double>, 3> travel;
  reader.read("host", controller.host);
  reader.read("port", controller.port);
  reader.read("rate", parameters.rate);
  reader.read("reply_timeout", controller.reply_timeout);
  reader.read("reconnect_period", parameters.reconnect_period);
  reader.read("spindle", controller.spindle);
  reader.read("marker_macro", controller.marker_macro);
  reader.read("orient_macro", controller.orient_macro);
  reader.read("settle_time", motion.settle_time);
  reader.read("condition_lead", motion.condition_lead);
  reader.read("standstill_speed", motion.standstill_speed);
  reader.read("stall_timeout", motion.stall_timeout);
  reader.read("stop_timeout", motion.stop_timeout);
  reader.read("open_timeout", motion.open_timeout);
  reader.read("model", model_file);
  reader.read("travel_x", travel[0]);
  reader.read("travel_y", travel[1]);
  reader.read("travel_z", travel[2]);
  reader.read("max_feed", motion.limits.max_feed);
  reader.read("max_spindle_speed", motion.limits.max_spindle_speed);
  reader.read("max_dwell", motion.limits.max_dwell);
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
      if (motion.limits.max_feed == 0.0) {
        motion.limits.max_feed = model.axes->rapid;
      }
    }
    if (model.spindle && model.spindle->max_speed && motion.limits.max_spindle_speed == 0.0) {
      motion.limits.max_spindle_speed = *model.spindle->max_speed;
    }
  }
  const std::string or_model = " (or a model that has it)";
  for (std::size_t i = 0; i < 3; ++i) {
    if (travel[i].size() != 2) {
      throw Error(std::string("travel_") + "xyz"[i] + ": lowest and highest position [m] are due" + or_model);
    }
    motion.limits.travel[i] = {travel[i][0], travel[i][1]};
  }
  if (motion.limits.max_feed == 0.0) {
    throw Error("max_feed: a feed above 0 [m/s] is due" + or_model);
  }
  if (motion.limits.max_spindle_speed == 0.0) {
    throw Error("max_spindle_speed: a speed above 0 [rad/s] is due" + or_model);
  }
  controller.validate();
  motion.validate();
  return parameters;
}

}  // namespace smartmill::cnc
