#include <utility>

#include "controller/calls/calls.h"
#include "controller/indicated_state.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;

class ProgramCalls : public CallsOf<focas::ProgramsInterface> {
 public:
  using CallsOf::CallsOf;

  std::vector<focas::StoredProgram> programs() const override { return machine_.lock()->memory.list(); }
  EwCode selectProgram(int number) override {
    const LockedMachine::Access machine = machine_.lock();
    return machine->memory.select(number, machine->program.fromMemory());
  }
  EwCode deleteProgram(int number) override {
    const LockedMachine::Access machine = machine_.lock();
    return machine->memory.erase(number, machine->program.fromMemory());
  }
  /// Every start begins at the first block of the program.
  EwCode rewindProgram() override {
    return statusOf(*machine_.lock()).run == focas::RUN_START ? focas::EW_BUSY : focas::EW_OK;
  }
  EwCode storePrograms(const std::string& text) override {
    const LockedMachine::Access machine = machine_.lock();
    return machine->memory.store(text, machine->program.fromMemory(), machine->calendar.now());
  }
  EwCode fetchPrograms(int first, int last, std::string* text) const override {
    std::optional<std::string> programs = machine_.lock()->memory.fetch(first, last);
    if (!programs) return focas::EW_DATA;
    *text = std::move(*programs);
    return focas::EW_OK;
  }
  /// Runs the main program in MEM; resumes after M0 and feed hold.
  EwCode cycleStart() override { return machine_.lock()->cycleStart(); }
  /// Stops axes and spindle, drops the program, ends the session (EW_RESET), clears alarms.
  EwCode reset() override {
    machine_.lock()->reset();
    return focas::EW_OK;
  }
};

}  // namespace

std::unique_ptr<focas::ProgramsInterface> programCalls(LockedMachine& machine) {
  return std::make_unique<ProgramCalls>(machine);
}

}  // namespace smartmill::sim
