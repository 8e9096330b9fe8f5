#include "controller/indicated_state.h"

#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::sim {

focas::Status statusOf(const ControlledMachine& machine) {
  focas::Status status;
  status.aut = static_cast<std::int16_t>(machine.mode());
  const bool moving = machine.axes.moving(machine.now());
  status.run = machine.program.held()                                  ? focas::RUN_HOLD
               : machine.program.busy() && !machine.program.stopped()  ? focas::RUN_START
               : machine.session.isOpen() || machine.program.stopped() ? focas::RUN_STOP
                                                                       : focas::RUN_RESET;
  status.motion = moving                                   ? focas::MOTION_MOVES
                  : machine.executor.dwells(machine.now()) ? focas::MOTION_DWELL
                                                           : focas::MOTION_NONE;
  status.mstb = machine.executor.waitsForM() && !moving ? 1 : 0;
  status.emergency = machine.isEmergency() ? 1 : 0;
  status.alarm = machine.alarms.empty() ? 0 : 1;
  return status;
}

std::string programTextOf(const ControlledMachine& machine) {
  if (machine.executor.running() || machine.session.isOpen() || machine.program.fromMemory())
    return machine.program.text();
  return machine.memory.text(machine.memory.selected()).value_or("");
}

PmcSignals signalsOf(const ControlledMachine& machine) {
  PmcSignals s;
  const double speed = machine.spindle.speed(machine.now());
  s.mode = machine.mode();
  s.operating = machine.program.busy() || machine.session.isOpen();
  s.started = machine.program.busy() && !machine.program.held() && !machine.program.stopped();
  s.held = machine.program.held();
  s.alarm = !machine.alarms.empty();
  s.emergency = machine.isEmergency();
  s.at_rest = speed == 0.0;
  s.at_speed = machine.spindle.atSpeed(machine.now());
  s.oriented = machine.spindle.oriented(machine.now());
  s.m_code = machine.executor.lastMCode();
  s.s_code = static_cast<int>(std::lround(units::rpmFromRadPerSec(machine.spindle.programmed())));
  s.spindle_speed = units::rpmFromRadPerSec(speed);
  s.feed_override = machine.overrides.feed(1.0);
  s.spindle_override = machine.overrides.spindle(1.0);
  return s;
}

double spindleLoadOf(const ControlledMachine& machine) {
  const double step = machine.options.load_step;
  return step > 0.0 ? step * std::round(machine.spindle_load / step) : machine.spindle_load;
}

}  // namespace smartmill::sim
