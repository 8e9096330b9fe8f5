#include "controller/machine.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;

constexpr const char* RESIDENT_PROGRAM = "O0001(PARK)\nG21 G90 G94\nG53 G0 Z0\nM5\nG53 G0 X0 Y0\nM30\n";

}  // namespace

ControlledMachine::ControlledMachine(const ControllerOptions& o)
    : options(o),
      memory(o.memory_size),
      calendar(o.wall_clock),
      heating(options),
      axes(options.axes),
      spindle(options, overrides),
      executor(options, overrides, variables, axes, spindle),
      program(executor, options.buffer_size),
      session(program),
      mode_(o.mode) {
  variables.offsets[0] = o.work_offset;
  // Every control has programs in its memory; the selected one parks the machine.
  memory.store(RESIDENT_PROGRAM, false, focas::DateTime());
  memory.select(1, false);
}

void ControlledMachine::step(double dt) {
  if (dt != dt_) {
    base_ = now_;
    dt_ = dt;
    steps_ = 0;
  }
  // A product instead of a sum: rounding errors do not accumulate.
  const double end = base_ + static_cast<double>(++steps_) * dt_;
  try {
    program.advance(now_, end);
  } catch (const NcAlarm& e) {
    alarmAt(program.time(),
            {e.number(), e.type(), e.axis(), std::string(e.what()) + ": " + program.indicated().block});
  }
  now_ = end;
  if (now_ - checked_ >= options.check_period) checkMotion();
}

void ControlledMachine::checkMotion() {
  const MotionState state = motion();
  if (checked_ >= 0.0) heating.advance(now_ - checked_, servo_load, spindle_load, state.spindle_speed);
  checked_ = now_;
  if (!axes.moving(now_) && state.spindle_speed == 0.0) return;
  for (const std::shared_ptr<const MotionWatch>& watch : options.watches) {
    if (!alarms.empty()) return;
    if (const std::optional<focas::AlarmMessage> fault = watch->check(state)) alarm(*fault);
  }
}

MotionState ControlledMachine::motion() const {
  return {axes.position(now_), axes.velocity(now_),          spindle.angle(now_),
          spindle.speed(now_), program.indicated().sequence, executor.tool()};
}

// --- the operator

void ControlledMachine::halt(double time, EwCode why) {
  program.halt(time);
  session.abort(why);
}

void ControlledMachine::alarmAt(double time, const focas::AlarmMessage& message) {
  alarms.push_back(message);
  halt(time, focas::EW_ALARM);
}

void ControlledMachine::setMode(int aut) {
  if (aut != mode_ && (program.busy() || session.isOpen() || program.held() || program.stopped()))
    halt(now_, focas::EW_MODE);
  mode_ = aut;
}

void ControlledMachine::emergency(bool on) {
  emergency_ = on;
  if (on) halt(now_, focas::EW_ALARM);
}

void ControlledMachine::reset() {
  halt(now_, focas::EW_RESET);
  alarms.clear();
  variables.clearLocals();
}

void ControlledMachine::updateDataTableOverrides() {
  focas::Bytes bytes;
  pmc.read(focas::PmcArea::d, OVERRIDE_DATA, OVERRIDE_DATA + 1, &bytes);
  const auto share = [](std::uint8_t percent) { return percent == 0 ? 1.0 : 0.01 * percent; };
  apply({share(bytes[0]), 1.0, share(bytes[1])}, overrides.data_table);
}

void ControlledMachine::apply(const Overrides::Factors& from, Overrides::Factors& to) {
  const bool spindle_changes = from.spindle != to.spindle;
  to = from;
  if (spindle_changes) spindle.follow(now_);
  program.updateFeed(now_);
}

EwCode ControlledMachine::cycleStart() {
  if (emergency_ || !alarms.empty()) return focas::EW_ALARM;
  if (mode_ != focas::AUT_MEM && mode_ != focas::AUT_REMOTE) return focas::EW_MODE;
  if (program.resume(now_) || program.busy() || mode_ == focas::AUT_REMOTE) return focas::EW_OK;
  const std::optional<std::string> text = memory.text(memory.selected());
  if (!text) return focas::EW_DATA;
  program.begin(memory.selected());
  program.load(*text);
  return focas::EW_OK;
}

// --- the DNC session

EwCode ControlledMachine::openSession() {
  if (emergency_ || !alarms.empty()) return focas::EW_ALARM;
  if (mode_ != focas::AUT_REMOTE) return focas::EW_MODE;
  if (session.isOpen() || program.busy() || axes.moving(now_)) return focas::EW_BUSY;
  session.open();
  return focas::EW_OK;
}

}  // namespace smartmill::sim
