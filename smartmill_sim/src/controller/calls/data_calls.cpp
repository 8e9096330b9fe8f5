#include "controller/calls/calls.h"
#include "controller/indicated_state.h"
#include "controller/machine_numbers.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;

class DataCalls : public CallsOf<focas::DataInterface> {
 public:
  using CallsOf::CallsOf;

  std::vector<focas::NumberedValue> parameters(int first, int last) const override {
    return within(machineParameters(machine_.options()), first, last);
  }
  std::vector<focas::NumberedValue> diagnoses(int first, int last) const override {
    const LockedMachine::Access machine = machine_.lock();
    const focas::Status status = statusOf(*machine);
    DiagnosisState state;
    state.waits_for_m = status.mstb != 0;
    state.moves = status.motion == focas::MOTION_MOVES;
    state.dwells = machine->executor.dwells(machine->now());
    state.at_zero_feed = status.run == focas::RUN_START && !state.moves &&
                         machine->axes.distanceToGo(machine->now()) != Variables::Point{};
    state.spindle_load = spindleLoadOf(*machine);
    state.spindle_angle = machine->motion().spindle_angle;
    state.axis_temperature = machine->heating.axes();
    state.spindle_temperature = machine->heating.spindle();
    return within(machineDiagnoses(state), first, last);
  }
  std::optional<focas::DateTime> dateTime() const override { return machine_.lock()->calendar.now(); }
  EwCode setDateTime(const focas::DateTime& date_time) override {
    machine_.lock()->calendar.set(date_time);
    return focas::EW_OK;
  }
  EwCode readPmc(focas::PmcArea area, int first, int last, focas::Bytes* bytes) const override {
    const LockedMachine::Access machine = machine_.lock();
    machine->pmc.update(signalsOf(*machine));
    return machine->pmc.read(area, first, last, bytes);
  }
  EwCode writePmc(focas::PmcArea area, int first, const focas::Bytes& bytes) override {
    const LockedMachine::Access machine = machine_.lock();
    const EwCode code = machine->pmc.write(area, first, bytes);
    if (area == focas::PmcArea::d) machine->updateDataTableOverrides();
    return code;
  }
};

}  // namespace

std::unique_ptr<focas::DataInterface> dataCalls(LockedMachine& machine) {
  return std::make_unique<DataCalls>(machine);
}

}  // namespace smartmill::sim
