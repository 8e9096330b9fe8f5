#include "smartmill_sim/controller/controller_options.h"

#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/controller/collision_watch.h"

namespace smartmill::sim {

ControllerOptions ControllerOptions::ofModel(const MachineModel& model) {
  ControllerOptions options;
  options.axes.travel = {{{-0.25, 0.25}, {-0.2, 0.2}, {-0.3, 0.0}}};
  options.axes.rapid = 30.0 * units::M_PER_MIN;
  options.axes.acceleration = 5.0;
  options.axes = model.axes.value_or(options.axes);
  const Spindle spindle = model.spindle.value_or(Spindle{});
  options.spindle_max_speed = spindle.max_speed.value_or(units::radPerSecFromRpm(20000.0));
  options.spindle_acceleration = spindle.acceleration.value_or(units::radPerSecFromRpm(10000.0));
  options.spindle_torque = spindle.rated_torque.value_or(0.0);
  if (spindle.load_meter_full_scale)
    options.load_step = 100.0 * LOAD_METER_STEP / *spindle.load_meter_full_scale;
  options.watches.push_back(std::make_shared<CollisionWatch>(CollisionWatch::ofModel(model)));
  return options;
}

focas::SysInfo ControllerOptions::fineInfo() {
  focas::SysInfo info;
  info.position_decimals = 4;
  info.load_decimals = 5;
  return info;
}

void ControllerOptions::validate() const {
  const auto positive = [](const char* key, double value) {
    if (!(value > 0.0) || !std::isfinite(value)) {
      throw Error(std::string("controller: ") + key + " is " + std::to_string(value) +
                  ", expected a value above 0");
    }
  };
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string axis(1, "xyz"[i]);
    if (!(axes.travel[i][0] < axes.travel[i][1])) {
      throw Error("controller: travel of " + axis + " from " + std::to_string(axes.travel[i][0]) + " to " +
                  std::to_string(axes.travel[i][1]) + " m is empty");
    }
    if (!(axes.home[i] >= axes.travel[i][0] && axes.home[i] <= axes.travel[i][1])) {
      throw Error("controller: home of " + axis + " at " + std::to_string(axes.home[i]) +
                  " m is outside the travel");
    }
    if (!std::isfinite(work_offset[i])) throw Error("controller: work_offset of " + axis + " is not finite");
  }
  positive("rapid", axes.rapid);
  positive("acceleration", axes.acceleration);
  positive("spindle_max_speed", spindle_max_speed);
  positive("spindle_acceleration", spindle_acceleration);
  if (!(spindle_torque >= 0.0) || !(load_step >= 0.0))
    throw Error("controller: spindle_torque and load_step must not be below 0");
  positive("motor_time_constant", motor_time_constant);
  if (!(motor_load_rise >= 0.0) || !(motor_idle_rise >= 0.0) || !std::isfinite(motor_temperature))
    throw Error(
        "controller: motor_load_rise and motor_idle_rise must not be below 0, and motor_temperature finite");
  if (buffer_size == 0) throw Error("controller: buffer_size is 0 bytes");
}

}  // namespace smartmill::sim
