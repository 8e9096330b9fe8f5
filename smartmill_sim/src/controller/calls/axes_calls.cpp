#include <cmath>

#include "controller/calls/calls.h"
#include "controller/indicated_state.h"
#include "controller/machine_numbers.h"

namespace smartmill::sim {
namespace {

std::vector<double> inMm(const std::array<double, 3>& v) {
  return {v[0] / units::MM, v[1] / units::MM, v[2] / units::MM};
}

class AxesCalls : public CallsOf<focas::AxesInterface> {
 public:
  using CallsOf::CallsOf;

  std::vector<double> machinePosition() const override {
    const LockedMachine::Access machine = machine_.lock();
    return inMm(machine->axes.position(machine->now()));
  }
  std::vector<double> absolutePosition() const override {
    const LockedMachine::Access machine = machine_.lock();
    return inMm(machine->executor.workPosition(machine->now()));
  }
  std::vector<double> relativePosition() const override { return absolutePosition(); }
  std::vector<double> distanceToGo() const override {
    const LockedMachine::Access machine = machine_.lock();
    return inMm(machine->axes.distanceToGo(machine->now()));
  }
  double actualFeed() const override {
    const LockedMachine::Access machine = machine_.lock();
    return machine->axes.speed(machine->now()) / MM_PER_MIN;
  }
  std::vector<double> spindleSpeed() const override {
    return {std::abs(units::rpmFromRadPerSec(machine_.lock()->motion().spindle_speed))};
  }
  std::vector<double> spindleLoad() const override { return {spindleLoadOf(*machine_.lock())}; }
  std::vector<double> spindleMaxSpeed() const override {
    return {units::rpmFromRadPerSec(machine_.options().spindle_max_speed)};
  }
  std::vector<double> servoLoad() const override {
    const LockedMachine::Access machine = machine_.lock();
    return {machine->servo_load.begin(), machine->servo_load.end()};
  }
  std::vector<double> servoCurrent() const override {
    const LockedMachine::Access machine = machine_.lock();
    return {machine->servo_current.begin(), machine->servo_current.end()};
  }
  std::vector<double> servoLoopGain() const override {
    const double gain = machine_.options().loop_gain;
    return {gain, gain, gain};
  }
  std::vector<double> servoSpeed() const override {
    const std::array<double, 3> velocity = machine_.lock()->motion().velocity;
    std::vector<double> speeds;
    for (const double v : velocity) speeds.push_back(60.0 * v / machine_.options().screw_lead);
    return speeds;
  }
};

}  // namespace

std::unique_ptr<focas::AxesInterface> axesCalls(LockedMachine& machine) {
  return std::make_unique<AxesCalls>(machine);
}

}  // namespace smartmill::sim
