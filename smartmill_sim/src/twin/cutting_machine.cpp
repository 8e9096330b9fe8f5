#include "smartmill_sim/twin/cutting_machine.h"

#include "smartmill_core/error.h"

namespace smartmill::sim {

void refuseEffects(const MachineModel& model) {
  if (!model.effects.empty()) {
    throw Error(model.file + ": effect " + model.effects.front().name + " is not simulated by this twin");
  }
}

CuttingMachine::CuttingMachine(const MachineModel& model, double time_step)
    : sign_(model.force_sensor.measures_workpiece ? -1.0 : 1.0), file_(model.file) {
  refuseEffects(model);
  const double rate = 1.0 / time_step;
  if (model.tool && model.cutting) {
    CuttingLaw law;
    law.coefficients = model.needCutting("simulate a cut");
    process_.emplace(*model.tool, law);
  }
  tip_.emplace_back(model.tool_tip.x, rate, Hold::first_order);
  tip_.emplace_back(model.tool_tip.y, rate, Hold::first_order);
  for (const ModalModel& axis : model.force_sensor.axis) {
    sensor_.emplace_back(axis, rate, Hold::first_order);
  }
  if (model.spindle) drive_.emplace(*model.spindle, time_step);
}

void CuttingMachine::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now) {
  if (!process_) throw Error(file_ + ": tool or cutting is missing (needed to simulate a cut)");
  process_->engage(arcs, now);
}

void CuttingMachine::resetLoadMeter(double spindle_speed) {
  if (drive_) drive_->reset(spindle_speed);
}

CuttingMachine::Output CuttingMachine::step(const Input& input) {
  Output out;
  ToolMotion motion = input.motion;
  // The tip's place needs this step's force and the force needs the place: the force is first taken to go on
  // in a straight line, which errs by the square of the step.
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const std::array<double, 2>& f = tip_history_[axis];
    motion.displacement[axis] = tip_[axis].peek(2.0 * f[0] - f[1]);
  }
  if (process_) out.force = process_->step(motion);
  out.applied = {{out.force.fx + input.sensor_force[0], out.force.fy + input.sensor_force[1],
                  out.force.fz + input.sensor_force[2]}};
  const std::array<double, 2> tip{{out.force.fx + input.tip_force[0], out.force.fy + input.tip_force[1]}};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    out.displacement[axis] = tip_[axis].step(tip[axis]);
    tip_history_[axis] = {{tip[axis], tip_history_[axis][0]}};
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    out.sensor[axis] = sign_ * sensor_[axis].step(out.applied[axis]);
  if (drive_) {
    out.load_meter = drive_->step(0.5 * (last_torque_ + out.force.torque), input.motion.speed);
    last_torque_ = out.force.torque;
  }
  return out;
}

}  // namespace smartmill::sim
