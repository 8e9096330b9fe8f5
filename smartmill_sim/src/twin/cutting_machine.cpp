#include "smartmill_sim/twin/cutting_machine.h"

#include "smartmill_core/error.h"
#include "smartmill_core/frames.h"
#include "twin/stage_run.h"

namespace smartmill::sim {
namespace {

CuttingForce turned(CuttingForce force, const std::array<double, 9>& rotation) {
  const std::array<double, 3> f = frames::rotate(rotation, {force.fx, force.fy, force.fz});
  force.fx = f[0];
  force.fy = f[1];
  force.fz = f[2];
  return force;
}

}  // namespace

CuttingMachine::CuttingMachine(const MachineModel& model, double time_step, Feed feed, int corner_slices)
    : parts_(model, setUpOf(model, EffectSet(model)), time_step, feed, corner_slices) {
}

void CuttingMachine::engage(const std::vector<ContactArc>& arcs, const ToolMotion& now, double rise) {
  if (!model().tool || !model().cutting)
    throw Error(model().file + ": tool or cutting is missing (needed to simulate a cut)");
  parts_.cut.contact.engage(arcs, now, rise);
  parts_.update(now);
  parts_.cut.engage(now, parts_.timeline.state());
}

void CuttingMachine::setDepth(double depth, double passed_over) {
  parts_.cut.contact.setDepth(depth, passed_over);
  parts_.cut.updateDepths(parts_.timeline.state());
}

void CuttingMachine::resetLoadMeter(double spindle_speed) {
  if (!model().spindle) return;
  ToolMotion motion;
  motion.speed = spindle_speed;
  parts_.update(motion);
  ChannelValues values{};
  values[LOAD_METER] = parts_.chain.resetLoad(spindle_speed);
  parts_.timeline.effects().measure(Stage::sensor_output, parts_.timeline.now(), values);
  parts_.chain.resetDelay(LOAD_METER, values[LOAD_METER]);
}

CuttingMachine::Output CuttingMachine::step(const Input& input) {
  Output out;
  step(input, out);
  return out;
}

void CuttingMachine::step(const Input& input, Output& out) {
  EffectTimeline& timeline = parts_.timeline;
  FlexibleCut& cut = parts_.cut;
  MeasuringChain& chain = parts_.chain;
  const EffectSet& effects = timeline.effects();
  parts_.beginStep(input);
  out.force = cut.force(input, timeline.state());
  out.applied = {{out.force.fx + input.sensor_force[0], out.force.fy + input.sensor_force[1],
                  out.force.fz + input.sensor_force[2]}};
  if (effects.has(Stage::sensor_force)) effects.addForce(timeline.now(), out.applied);
  cut.moveTip(input, out.force, out.raw);
  if (to_sensor_) {
    chain.measure(turned(cut.last(), *to_sensor_), turned(out.force, *to_sensor_), cut.contact.jump(),
                  frames::rotate(*to_sensor_, out.applied), input.motion.speed, out.raw);
  } else {
    chain.measure(cut.last(), out.force, cut.contact.jump(), out.applied, input.motion.speed, out.raw);
  }
  cut.endStep(out.force);
  if (effects.has(Stage::sensor_output)) effects.measure(Stage::sensor_output, timeline.now(), out.raw);
  chain.filter(out.raw);
  ChannelValues measured = out.raw;
  if (effects.has(Stage::signal)) effects.measure(Stage::signal, timeline.now(), measured);
  out.sensor = {{measured[FX], measured[FY], measured[FZ]}};
  out.load_meter = measured[LOAD_METER];
  out.displacement = {{measured[TOOL_X], measured[TOOL_Y]}};
  parts_.endSteps(input.motion);
}

void CuttingMachine::run(std::size_t steps, const std::function<void(std::size_t, Input&)>& next,
                         const ChannelRows& raw) {
  StageRun(parts_).run(steps, next, raw);
}

}  // namespace smartmill::sim
