#include "controller/calls/calls.h"
#include "controller/indicated_state.h"

namespace smartmill::sim {
namespace {

class StateCalls : public CallsOf<focas::StateInterface> {
 public:
  using CallsOf::CallsOf;

  focas::SysInfo sysInfo() const override { return machine_.options().info; }
  focas::Status status() const override { return statusOf(*machine_.lock()); }
  std::uint32_t alarmBits() const override {
    std::uint32_t bits = 0;
    for (const focas::AlarmMessage& alarm : alarmMessages()) bits |= 1U << static_cast<unsigned>(alarm.type);
    return bits;
  }
  std::vector<focas::AlarmMessage> alarmMessages() const override { return machine_.lock()->alarms; }
  int runningProgram() const override { return machine_.lock()->program.indicated().program; }
  int mainProgram() const override { return machine_.lock()->memory.selected(); }
  int sequenceNumber() const override { return machine_.lock()->program.indicated().sequence; }
  int blockCount() const override { return machine_.lock()->program.indicated().blocks; }
  std::string programPath() const override {
    const LockedMachine::Access machine = machine_.lock();
    for (const focas::StoredProgram& program : machine->memory.list()) {
      if (program.number == machine->memory.selected()) return focas::PROGRAM_FOLDER + program.name;
    }
    return "";
  }
  std::string executingBlock() const override { return machine_.lock()->program.indicated().block; }
  std::string programText() const override { return programTextOf(*machine_.lock()); }
};

}  // namespace

std::unique_ptr<focas::StateInterface> stateCalls(LockedMachine& machine) {
  return std::make_unique<StateCalls>(machine);
}

}  // namespace smartmill::sim
