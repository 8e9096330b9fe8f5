#include "smartmill_sim/controller/controller.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <mutex>
#include <utility>

#include "controller/machine.h"
#include "controller/machine_numbers.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;
using Lock = std::lock_guard<std::mutex>;

constexpr double MM_PER_MIN = units::MM / 60.0;
constexpr double SCREW_LEAD = 10.0 * units::MM;  // [m] per revolution of an axis motor
constexpr double LOAD_METER_STEP_VOLT = 3.0e-4;  // [V] resolution of the load meter (Dunwoody 3.2.1)

std::vector<double> inMm(const std::array<double, 3>& v) {
  return {v[0] / units::MM, v[1] / units::MM, v[2] / units::MM};
}

std::string numberText(double value) {
  return std::to_string(value);
}

focas::DateTime calendar(std::int64_t seconds) {
  const std::time_t time = static_cast<std::time_t>(seconds);
  std::tm parts{};
  gmtime_r(&time, &parts);
  return {parts.tm_year + 1900, parts.tm_mon + 1, parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec};
}

std::int64_t secondsOf(const focas::DateTime& at) {
  std::tm parts{};
  parts.tm_year = at.year - 1900;
  parts.tm_mon = at.month - 1;
  parts.tm_mday = at.day;
  parts.tm_hour = at.hour;
  parts.tm_min = at.minute;
  parts.tm_sec = at.second;
  return timegm(&parts);
}

/// Wall clock of the computer in local time.
std::int64_t localSeconds() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  localtime_r(&now, &parts);
  return timegm(&parts);
}

}  // namespace

ControllerOptions ControllerOptions::ofModel(const MachineModel& model) {
  ControllerOptions options;
  options.axes.travel = {{{-0.25, 0.25}, {-0.2, 0.2}, {-0.3, 0.0}}};
  options.axes.rapid = 30.0 * units::M_PER_MIN;
  options.axes.acceleration = 5.0;
  options.axes = model.axes.value_or(options.axes);
  const Spindle spindle = model.spindle.value_or(Spindle{});
  options.spindle_max_speed = spindle.max_speed.value_or(units::radPerSecFromRpm(20000.0));
  options.spindle_acceleration = spindle.acceleration.value_or(units::radPerSecFromRpm(10000.0));
  options.spindle_torque = spindle.rated_torque.value_or(0.0);
  if (spindle.load_meter_full_scale) {
    options.load_step = 100.0 * LOAD_METER_STEP_VOLT / *spindle.load_meter_full_scale;
  }
  options.obstacles = CollisionWatch::ofModel(model);
  return options;
}

focas::SysInfo ControllerOptions::fineInfo() {
  focas::SysInfo info;
  info.position_decimals = 4;
  info.load_decimals = 5;
  return info;
}

void ControllerOptions::validate() const {
  const auto positive = [](const char* key, double value) {
    if (!(value > 0.0) || !std::isfinite(value)) {
      throw Error(std::string("controller: ") + key + " is " + numberText(value) +
                  ", expected a value above 0");
    }
  };
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string axis(1, "xyz"[i]);
    if (!(axes.travel[i][0] < axes.travel[i][1])) {
      throw Error("controller: travel of " + axis + " from " + numberText(axes.travel[i][0]) + " to " +
                  numberText(axes.travel[i][1]) + " m is empty");
    }
    if (!(axes.home[i] >= axes.travel[i][0] && axes.home[i] <= axes.travel[i][1])) {
      throw Error("controller: home of " + axis + " at " + numberText(axes.home[i]) +
                  " m is outside the travel");
    }
    if (!std::isfinite(work_offset[i])) {
      throw Error("controller: work_offset of " + axis + " is not finite");
    }
  }
  positive("rapid", axes.rapid);
  positive("acceleration", axes.acceleration);
  positive("spindle_max_speed", spindle_max_speed);
  positive("spindle_acceleration", spindle_acceleration);
  if (!(spindle_torque >= 0.0) || !(load_step >= 0.0)) {
    throw Error("controller: spindle_torque and load_step must not be below 0");
  }
  if (buffer_size == 0) {
    throw Error("controller: buffer_size is 0 bytes");
  }
}

/// The machine and its lock.
class Controller::Impl {
 public:
  explicit Impl(const ControllerOptions& options) : machine(options) {}

  mutable std::mutex mutex;
  ControlledMachine machine;

  std::int64_t clock() const {
    const std::function<std::int64_t()>& wall = machine.options.wall_clock;
    return (wall ? wall() : localSeconds()) + machine.clock_offset;
  }
  double polled(double load) const {
    const double step = machine.options.load_step;
    return step > 0.0 ? step * std::round(load / step) : load;
  }
};

Controller::Controller(const ControllerOptions& options) {
  options.validate();
  impl_ = std::make_unique<Impl>(options);
}

Controller::~Controller() = default;

void Controller::advance(double dt, std::size_t count, std::vector<MotionState>& states) {
  const Lock lock(impl_->mutex);
  states.resize(count);
  for (MotionState& state : states) {
    impl_->machine.step(dt);
    state = impl_->machine.motion();
  }
}

MotionState Controller::motion() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.motion();
}

void Controller::setSpindleLoad(double percent) {
  const Lock lock(impl_->mutex);
  impl_->machine.spindle_load = percent;
}

void Controller::setServoLoad(const std::array<double, 3>& percent) {
  const Lock lock(impl_->mutex);
  impl_->machine.servo_load = percent;
}

void Controller::setServoCurrent(const std::array<double, 3>& amperes) {
  const Lock lock(impl_->mutex);
  impl_->machine.servo_current = amperes;
}

void Controller::setSpindleTorque(double torque) {
  const Lock lock(impl_->mutex);
  impl_->machine.setSpindleTorque(torque);
}

void Controller::feedHold() {
  const Lock lock(impl_->mutex);
  impl_->machine.feedHold();
}

void Controller::setOverrides(double feed, double rapid, double spindle) {
  const Lock lock(impl_->mutex);
  impl_->machine.setOverrides(std::clamp(feed, 0.0, 2.0), std::clamp(rapid, 0.0, 1.0),
                              std::clamp(spindle, 0.5, 1.2));
}

void Controller::setMode(int aut) {
  const Lock lock(impl_->mutex);
  impl_->machine.setMode(aut);
}

void Controller::raiseAlarm(int number, const std::string& text) {
  const Lock lock(impl_->mutex);
  impl_->machine.alarm({number, ALARM_EX, 0, text});
}

void Controller::emergency(bool on) {
  const Lock lock(impl_->mutex);
  impl_->machine.emergency(on);
}

focas::SysInfo Controller::sysInfo() const {
  return impl_->machine.options.info;
}

focas::Status Controller::status() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.status();
}

std::vector<double> Controller::machinePosition() const {
  const Lock lock(impl_->mutex);
  return inMm(impl_->machine.position());
}

std::vector<double> Controller::absolutePosition() const {
  const Lock lock(impl_->mutex);
  return inMm(impl_->machine.workPosition());
}

std::vector<double> Controller::relativePosition() const {
  return absolutePosition();
}

std::vector<double> Controller::distanceToGo() const {
  const Lock lock(impl_->mutex);
  return inMm(impl_->machine.distanceToGo());
}

double Controller::actualFeed() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.pathSpeed() / MM_PER_MIN;
}

std::vector<double> Controller::spindleSpeed() const {
  const Lock lock(impl_->mutex);
  return {std::abs(units::rpmFromRadPerSec(impl_->machine.spindleSpeed()))};
}

std::vector<double> Controller::spindleLoad() const {
  const Lock lock(impl_->mutex);
  return {impl_->polled(impl_->machine.spindle_load)};
}

std::vector<double> Controller::spindleMaxSpeed() const {
  return {units::rpmFromRadPerSec(impl_->machine.options.spindle_max_speed)};
}

std::vector<double> Controller::servoLoad() const {
  const Lock lock(impl_->mutex);
  return {impl_->machine.servo_load.begin(), impl_->machine.servo_load.end()};
}

std::vector<double> Controller::servoCurrent() const {
  const Lock lock(impl_->mutex);
  return {impl_->machine.servo_current.begin(), impl_->machine.servo_current.end()};
}

std::vector<double> Controller::servoLoopGain() const {
  return {LOOP_GAIN, LOOP_GAIN, LOOP_GAIN};
}

std::vector<double> Controller::servoSpeed() const {
  const Lock lock(impl_->mutex);
  std::vector<double> speeds;
  for (const double v : impl_->machine.velocity()) {
    speeds.push_back(60.0 * v / SCREW_LEAD);
  }
  return speeds;
}

EwCode Controller::readMacro(int number, std::optional<double>* value) const {
  if (!Variables::exists(number)) {
    return focas::EW_NUMBER;
  }
  const Lock lock(impl_->mutex);
  *value = impl_->machine.readVariable(number);
  return focas::EW_OK;
}

EwCode Controller::writeMacro(int number, std::optional<double> value) {
  if (!Variables::exists(number)) {
    return focas::EW_NUMBER;
  }
  if (!Variables::writable(number)) {
    return focas::EW_PROT;
  }
  const Lock lock(impl_->mutex);
  impl_->machine.variables.write(number, value);
  return focas::EW_OK;
}

std::uint32_t Controller::alarmBits() const {
  const Lock lock(impl_->mutex);
  std::uint32_t bits = 0;
  for (const focas::AlarmMessage& alarm : impl_->machine.alarms) {
    bits |= 1U << static_cast<unsigned>(alarm.type);
  }
  return bits;
}

std::vector<focas::AlarmMessage> Controller::alarmMessages() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.alarms;
}

int Controller::runningProgram() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.runningProgram();
}

int Controller::mainProgram() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.mainProgram();
}

int Controller::sequenceNumber() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.sequence;
}

int Controller::blockCount() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.blocks;
}

std::string Controller::programPath() const {
  const Lock lock(impl_->mutex);
  for (const focas::StoredProgram& program : impl_->machine.memory.list()) {
    if (program.number == impl_->machine.mainProgram()) {
      return programFolder() + program.name;
    }
  }
  return "";
}

std::string Controller::executingBlock() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.block_text;
}

std::string Controller::programText() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.programText();
}

std::vector<focas::NumberedValue> Controller::parameters(int first, int last) const {
  return within(machineParameters(impl_->machine.options), first, last);
}

std::vector<focas::NumberedValue> Controller::diagnoses(int first, int last) const {
  const Lock lock(impl_->mutex);
  const ControlledMachine& machine = impl_->machine;
  const focas::Status status = machine.status();
  DiagnosisState state;
  state.waits_for_m = status.mstb != 0;
  state.moves = status.motion == focas::MOTION_MOVES;
  state.dwells = machine.dwells();
  state.at_zero_feed =
      status.run == focas::RUN_START && !state.moves && machine.distanceToGo() != Variables::Point{};
  state.spindle_load = impl_->polled(machine.spindle_load);
  state.spindle_angle = machine.motion().spindle_angle;
  return within(machineDiagnoses(state), first, last);
}

std::optional<focas::DateTime> Controller::dateTime() const {
  const Lock lock(impl_->mutex);
  return calendar(impl_->clock());
}

EwCode Controller::setDateTime(const focas::DateTime& date_time) {
  const Lock lock(impl_->mutex);
  impl_->machine.clock_offset += secondsOf(date_time) - impl_->clock();
  return focas::EW_OK;
}

EwCode Controller::readPmc(focas::PmcArea area, int first, int last, focas::Bytes* bytes) const {
  const Lock lock(impl_->mutex);
  impl_->machine.pmc.update(impl_->machine.signals());
  return impl_->machine.pmc.read(area, first, last, bytes);
}

EwCode Controller::writePmc(focas::PmcArea area, int first, const focas::Bytes& bytes) {
  const Lock lock(impl_->mutex);
  const EwCode code = impl_->machine.pmc.write(area, first, bytes);
  if (area == focas::PmcArea::d) {
    impl_->machine.updateDataTableOverrides();
  }
  return code;
}

std::vector<focas::StoredProgram> Controller::programs() const {
  const Lock lock(impl_->mutex);
  return impl_->machine.memory.list();
}

EwCode Controller::selectProgram(int number) {
  const Lock lock(impl_->mutex);
  return impl_->machine.select(number);
}

EwCode Controller::deleteProgram(int number) {
  const Lock lock(impl_->mutex);
  return impl_->machine.erase(number);
}

EwCode Controller::rewindProgram() {
  const Lock lock(impl_->mutex);
  // Every start begins at the first block of the program.
  return impl_->machine.status().run == focas::RUN_START ? focas::EW_BUSY : focas::EW_OK;
}

EwCode Controller::storePrograms(const std::string& text) {
  const Lock lock(impl_->mutex);
  return impl_->machine.store(text, calendar(impl_->clock()));
}

EwCode Controller::fetchPrograms(int first, int last, std::string* text) const {
  const Lock lock(impl_->mutex);
  std::optional<std::string> programs = impl_->machine.memory.fetch(first, last);
  if (!programs) {
    return focas::EW_DATA;
  }
  *text = std::move(*programs);
  return focas::EW_OK;
}

EwCode Controller::cycleStart() {
  const Lock lock(impl_->mutex);
  return impl_->machine.cycleStart();
}

EwCode Controller::reset() {
  const Lock lock(impl_->mutex);
  impl_->machine.reset();
  return focas::EW_OK;
}

EwCode Controller::dncStart() {
  const Lock lock(impl_->mutex);
  return impl_->machine.openSession();
}

std::size_t Controller::dncData(const char* data, std::size_t size) {
  const Lock lock(impl_->mutex);
  return impl_->machine.receive(data, size);
}

EwCode Controller::dncEnd() {
  const Lock lock(impl_->mutex);
  return impl_->machine.closeSession();
}

void Controller::dncCancel(int /*result*/) {
  const Lock lock(impl_->mutex);
  impl_->machine.cancelSession();
}

EwCode Controller::dncAbort() {
  const Lock lock(impl_->mutex);
  return impl_->machine.takeAbortCode();
}

}  // namespace smartmill::sim
