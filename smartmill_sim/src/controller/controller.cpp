#include "smartmill_sim/controller/controller.h"

#include <algorithm>

#include "controller/calls/calls.h"

namespace smartmill::sim {

/// The machine behind its lock, and its answers to the calls of each topic.
struct Controller::Impl {
  explicit Impl(const ControllerOptions& options) : machine(options) {}

  LockedMachine machine;
  const std::unique_ptr<focas::StateInterface> state = stateCalls(machine);
  const std::unique_ptr<focas::AxesInterface> axes = axesCalls(machine);
  const std::unique_ptr<focas::MacroInterface> macros = macroCalls(machine);
  const std::unique_ptr<focas::DataInterface> data = dataCalls(machine);
  const std::unique_ptr<focas::ProgramsInterface> programs = programCalls(machine);
  const std::unique_ptr<focas::DncInterface> dnc = dncCalls(machine);
};

Controller::Controller(const ControllerOptions& options) {
  options.validate();
  impl_ = std::make_unique<Impl>(options);
}

Controller::~Controller() = default;

void Controller::advance(double dt, std::size_t count, std::vector<MotionState>& states) {
  const LockedMachine::Access machine = impl_->machine.lock();
  states.resize(count);
  for (MotionState& state : states) {
    machine->step(dt);
    state = machine->motion();
  }
}

MotionState Controller::motion() const {
  return impl_->machine.lock()->motion();
}

void Controller::setSpindleLoad(double percent) {
  impl_->machine.lock()->spindle_load = percent;
}

void Controller::setServoLoad(const std::array<double, 3>& percent) {
  impl_->machine.lock()->servo_load = percent;
}

void Controller::setServoCurrent(const std::array<double, 3>& amperes) {
  impl_->machine.lock()->servo_current = amperes;
}

void Controller::setSpindleTorque(double torque) {
  const LockedMachine::Access machine = impl_->machine.lock();
  machine->spindle.setTorque(machine->now(), torque);
}

void Controller::feedHold() {
  const LockedMachine::Access machine = impl_->machine.lock();
  machine->program.hold(machine->now());
}

void Controller::setOverrides(double feed, double rapid, double spindle) {
  impl_->machine.lock()->setOverrides(
      {std::clamp(feed, 0.0, 2.0), std::clamp(rapid, 0.0, 1.0), std::clamp(spindle, 0.5, 1.2)});
}

void Controller::setMode(int aut) {
  impl_->machine.lock()->setMode(aut);
}

void Controller::raiseAlarm(int number, const std::string& text) {
  impl_->machine.lock()->alarm({number, ALARM_EX, 0, text});
}

void Controller::emergency(bool on) {
  impl_->machine.lock()->emergency(on);
}

focas::ControllerInterface Controller::calls() const {
  return {*impl_->state, *impl_->axes, *impl_->macros, *impl_->data, *impl_->programs, *impl_->dnc};
}

}  // namespace smartmill::sim
