#include "smartmill_sim/controller/controller.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <utility>

#include "controller/indicated_state.h"
#include "controller/machine.h"
#include "controller/machine_numbers.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;

constexpr double SCREW_LEAD = 10.0 * units::MM;  // [m] per revolution of an axis motor

std::vector<double> inMm(const std::array<double, 3>& v) {
  return {v[0] / units::MM, v[1] / units::MM, v[2] / units::MM};
}

}  // namespace

/// The machine behind its lock.
class Controller::Impl {
 public:
  explicit Impl(const ControllerOptions& options) : machine_(options) {}

  /// Exclusive access to the machine.
  class Access {
   public:
    explicit Access(Impl& impl) : lock_(impl.mutex_), machine_(impl.machine_) {}
    ControlledMachine* operator->() const { return &machine_; }
    const ControlledMachine& operator*() const { return machine_; }

   private:
    std::lock_guard<std::mutex> lock_;
    ControlledMachine& machine_;
  };
  Access locked() { return Access(*this); }
  const ControllerOptions& options() const { return machine_.options; }

 private:
  std::mutex mutex_;
  ControlledMachine machine_;
};

Controller::Controller(const ControllerOptions& options) {
  options.validate();
  impl_ = std::make_unique<Impl>(options);
}

Controller::~Controller() = default;

void Controller::advance(double dt, std::size_t count, std::vector<MotionState>& states) {
  const Impl::Access machine = impl_->locked();
  states.resize(count);
  for (MotionState& state : states) {
    machine->step(dt);
    state = machine->motion();
  }
}

MotionState Controller::motion() const {
  return impl_->locked()->motion();
}

void Controller::setSpindleLoad(double percent) {
  impl_->locked()->spindle_load = percent;
}

void Controller::setServoLoad(const std::array<double, 3>& percent) {
  impl_->locked()->servo_load = percent;
}

void Controller::setServoCurrent(const std::array<double, 3>& amperes) {
  impl_->locked()->servo_current = amperes;
}

void Controller::setSpindleTorque(double torque) {
  const Impl::Access machine = impl_->locked();
  machine->spindle.setTorque(machine->now(), torque);
}

void Controller::feedHold() {
  const Impl::Access machine = impl_->locked();
  machine->program.hold(machine->now());
}

void Controller::setOverrides(double feed, double rapid, double spindle) {
  impl_->locked()->setOverrides(
      {std::clamp(feed, 0.0, 2.0), std::clamp(rapid, 0.0, 1.0), std::clamp(spindle, 0.5, 1.2)});
}

void Controller::setMode(int aut) {
  impl_->locked()->setMode(aut);
}

void Controller::raiseAlarm(int number, const std::string& text) {
  impl_->locked()->alarm({number, ALARM_EX, 0, text});
}

void Controller::emergency(bool on) {
  impl_->locked()->emergency(on);
}

focas::SysInfo Controller::sysInfo() const {
  return impl_->options().info;
}

focas::Status Controller::status() const {
  return statusOf(*impl_->locked());
}

std::vector<double> Controller::machinePosition() const {
  const Impl::Access machine = impl_->locked();
  return inMm(machine->axes.position(machine->now()));
}

std::vector<double> Controller::absolutePosition() const {
  const Impl::Access machine = impl_->locked();
  return inMm(machine->executor.workPosition(machine->now()));
}

std::vector<double> Controller::relativePosition() const {
  return absolutePosition();
}

std::vector<double> Controller::distanceToGo() const {
  const Impl::Access machine = impl_->locked();
  return inMm(machine->axes.distanceToGo(machine->now()));
}

double Controller::actualFeed() const {
  const Impl::Access machine = impl_->locked();
  return machine->axes.speed(machine->now()) / MM_PER_MIN;
}

std::vector<double> Controller::spindleSpeed() const {
  return {std::abs(units::rpmFromRadPerSec(impl_->locked()->motion().spindle_speed))};
}

std::vector<double> Controller::spindleLoad() const {
  return {spindleLoadOf(*impl_->locked())};
}

std::vector<double> Controller::spindleMaxSpeed() const {
  return {units::rpmFromRadPerSec(impl_->options().spindle_max_speed)};
}

std::vector<double> Controller::servoLoad() const {
  const Impl::Access machine = impl_->locked();
  return {machine->servo_load.begin(), machine->servo_load.end()};
}

std::vector<double> Controller::servoCurrent() const {
  const Impl::Access machine = impl_->locked();
  return {machine->servo_current.begin(), machine->servo_current.end()};
}

std::vector<double> Controller::servoLoopGain() const {
  return {LOOP_GAIN, LOOP_GAIN, LOOP_GAIN};
}

std::vector<double> Controller::servoSpeed() const {
  std::vector<double> speeds;
  for (const double v : motion().velocity) speeds.push_back(60.0 * v / SCREW_LEAD);
  return speeds;
}

EwCode Controller::readMacro(int number, std::optional<double>* value) const {
  if (!Variables::exists(number)) return focas::EW_NUMBER;
  *value = impl_->locked()->variable(number);
  return focas::EW_OK;
}

EwCode Controller::writeMacro(int number, std::optional<double> value) {
  if (!Variables::exists(number)) return focas::EW_NUMBER;
  if (!Variables::writable(number)) return focas::EW_PROT;
  impl_->locked()->variables.write(number, value);
  return focas::EW_OK;
}

std::uint32_t Controller::alarmBits() const {
  std::uint32_t bits = 0;
  for (const focas::AlarmMessage& alarm : alarmMessages()) bits |= 1U << static_cast<unsigned>(alarm.type);
  return bits;
}

std::vector<focas::AlarmMessage> Controller::alarmMessages() const {
  return impl_->locked()->alarms;
}

int Controller::runningProgram() const {
  return impl_->locked()->program.indicated().program;
}

int Controller::mainProgram() const {
  return impl_->locked()->memory.selected();
}

int Controller::sequenceNumber() const {
  return impl_->locked()->program.indicated().sequence;
}

int Controller::blockCount() const {
  return impl_->locked()->program.indicated().blocks;
}

std::string Controller::programPath() const {
  const Impl::Access machine = impl_->locked();
  for (const focas::StoredProgram& program : machine->memory.list()) {
    if (program.number == machine->memory.selected()) return programFolder() + program.name;
  }
  return "";
}

std::string Controller::executingBlock() const {
  return impl_->locked()->program.indicated().block;
}

std::string Controller::programText() const {
  return programTextOf(*impl_->locked());
}

std::vector<focas::NumberedValue> Controller::parameters(int first, int last) const {
  return within(machineParameters(impl_->options()), first, last);
}

std::vector<focas::NumberedValue> Controller::diagnoses(int first, int last) const {
  const Impl::Access machine = impl_->locked();
  const focas::Status status = statusOf(*machine);
  DiagnosisState state;
  state.waits_for_m = status.mstb != 0;
  state.moves = status.motion == focas::MOTION_MOVES;
  state.dwells = machine->executor.dwells(machine->now());
  state.at_zero_feed = status.run == focas::RUN_START && !state.moves &&
                       machine->axes.distanceToGo(machine->now()) != Variables::Point{};
  state.spindle_load = spindleLoadOf(*machine);
  state.spindle_angle = machine->motion().spindle_angle;
  return within(machineDiagnoses(state), first, last);
}

std::optional<focas::DateTime> Controller::dateTime() const {
  return impl_->locked()->calendar.now();
}

EwCode Controller::setDateTime(const focas::DateTime& date_time) {
  impl_->locked()->calendar.set(date_time);
  return focas::EW_OK;
}

EwCode Controller::readPmc(focas::PmcArea area, int first, int last, focas::Bytes* bytes) const {
  const Impl::Access machine = impl_->locked();
  machine->pmc.update(signalsOf(*machine));
  return machine->pmc.read(area, first, last, bytes);
}

EwCode Controller::writePmc(focas::PmcArea area, int first, const focas::Bytes& bytes) {
  const Impl::Access machine = impl_->locked();
  const EwCode code = machine->pmc.write(area, first, bytes);
  if (area == focas::PmcArea::d) machine->updateDataTableOverrides();
  return code;
}

std::vector<focas::StoredProgram> Controller::programs() const {
  return impl_->locked()->memory.list();
}

EwCode Controller::selectProgram(int number) {
  const Impl::Access machine = impl_->locked();
  return machine->memory.select(number, machine->program.fromMemory());
}

EwCode Controller::deleteProgram(int number) {
  const Impl::Access machine = impl_->locked();
  return machine->memory.erase(number, machine->program.fromMemory());
}

EwCode Controller::rewindProgram() {
  // Every start begins at the first block of the program.
  return statusOf(*impl_->locked()).run == focas::RUN_START ? focas::EW_BUSY : focas::EW_OK;
}

EwCode Controller::storePrograms(const std::string& text) {
  const Impl::Access machine = impl_->locked();
  return machine->memory.store(text, machine->program.fromMemory(), machine->calendar.now());
}

EwCode Controller::fetchPrograms(int first, int last, std::string* text) const {
  std::optional<std::string> programs = impl_->locked()->memory.fetch(first, last);
  if (!programs) return focas::EW_DATA;
  *text = std::move(*programs);
  return focas::EW_OK;
}

EwCode Controller::cycleStart() {
  return impl_->locked()->cycleStart();
}

EwCode Controller::reset() {
  impl_->locked()->reset();
  return focas::EW_OK;
}

EwCode Controller::dncStart() {
  return impl_->locked()->openSession();
}

std::size_t Controller::dncData(const char* data, std::size_t size) {
  return impl_->locked()->session.receive(data, size);
}

EwCode Controller::dncEnd() {
  return impl_->locked()->session.close();
}

void Controller::dncCancel(int /*result*/) {
  impl_->locked()->cancelSession();
}

EwCode Controller::dncAbort() {
  return impl_->locked()->session.takeAbortCode();
}

}  // namespace smartmill::sim
