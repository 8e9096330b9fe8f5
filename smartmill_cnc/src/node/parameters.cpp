#include "node/parameters.h"

#include <sstream>

#include "smartmill_core/error.h"
#include "smartmill_core/io/data_folder.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/names.h"

namespace smartmill::cnc {
namespace {

/// Takes missing limits from the model.
void fill(NodeParameters& parameters, const MachineModel& model) {
  MotionLimits& limits = parameters.motion.limits;
  if (model.axes) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (parameters.travel[i].empty()) {
        parameters.travel[i] = {model.axes->travel[i][0], model.axes->travel[i][1]};
      }
    }
    if (limits.max_feed == 0.0) {
      limits.max_feed = model.axes->rapid;
    }
  }
  if (model.spindle && model.spindle->max_speed && limits.max_spindle_speed == 0.0) {
    limits.max_spindle_speed = *model.spindle->max_speed;
  }
}

}  // namespace

void NodeParameters::declare(ParameterTable& table) {
  table.title("Parameters of cnc_node (package smartmill_cnc): the bridge to the controller.");
  table.section();
  table.choice("controller", kind, {"fanuc", "linuxcnc"},
               "fanuc: over FOCAS Ethernet; linuxcnc: a LinuxCNC of this computer");
  table.section("Fanuc.");
  controller.declare(table);
  table.section("LinuxCNC.");
  linuxcnc.declare(table);
  table.text("load_input", load_input,
             "topic (LoadSample) of a load meter outside the controller; empty: none");
  table.number("load_timeout", load_timeout, "s", Range::positive(),
               "age from which on the load of load_input is not known (NaN)");
  table.section();
  table.number("rate", rate, "Hz", Range::closed(1.0, 200.0), "rate of cnc/state and cnc/load");
  table.number("reconnect_period", reconnect_period, "s", Range::positive(),
               "time between the first two attempts to connect, then up to eight times as long");
  motion.declare(table);
  table.text(
      "motion_nodes", motion_nodes,
      "nodes that move the machine on behalf of the client that has armed motion, separated by blanks; every "
      "other client is refused");
  table.text(
      "motion_log", motion_log,
      "file to which a line is added whenever motion is armed, disarmed or commanded; auto: motion.log in "
      "$STATE_DIRECTORY, $XDG_DATA_HOME/smartmill or ~/.local/share/smartmill; empty: none");
  table.section(
      "Limits of every motion, checked before anything is sent. An empty or zero value is taken from the "
      "axes and "
      "spindle sections of the machine model; every limit is required here or there.");
  table.text("model", model, "path of a smartmill-model/1 file");
  table.list("travel_x", travel[0], "m", {},
             "lowest and highest machine position, for example [-0.25, 0.25]");
  table.list("travel_y", travel[1], "m", {}, "of y");
  table.list("travel_z", travel[2], "m", {}, "of z");
  motion.limits.declare(table);
}

void NodeParameters::validate() const {
  checkBounds(*this);
  if (kind == "fanuc") {
    controller.validate();
  } else if (linuxcnc.folder.empty()) {
    throw Error("linuxcnc_folder: empty, expected the folder of the machine");
  }
}

std::vector<std::string> NodeParameters::helpers() const {
  std::vector<std::string> list;
  std::stringstream words(motion_nodes);
  for (std::string word; words >> word;) list.push_back(names::absolute(word));
  return list;
}

std::string NodeParameters::motionLogFile() const {
  return motion_log == "auto" ? dataFile(DataFolders::ofEnvironment(), "motion.log") : motion_log;
}

NodeParameters NodeParameters::completed() const {
  NodeParameters complete = *this;
  if (!model.empty()) {
    fill(complete, readMachineModel(model));
  }
  const std::string or_model = " (or a model with it)";
  MotionLimits& limits = complete.motion.limits;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::vector<double>& ends = complete.travel[i];
    if (ends.size() != 2) {
      throw Error(std::string("travel_") + "xyz"[i] + ": expected lowest and highest position [m]" +
                  or_model);
    }
    limits.travel[i] = {ends[0], ends[1]};
  }
  if (limits.max_feed == 0.0) {
    throw Error("max_feed: expected a feed above 0 m/s" + or_model);
  }
  if (limits.max_spindle_speed == 0.0) {
    throw Error("max_spindle_speed: expected a speed above 0 rad/s" + or_model);
  }
  complete.motion.validate();
  return complete;
}

}  // namespace smartmill::cnc
