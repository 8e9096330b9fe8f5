#include "smartmill_sim/controller/controller.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/controller/nc_block.h"
#include "smartmill_sim/controller/spindle_motion.h"
#include "smartmill_sim/controller/straight_move.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;
using Lock = std::lock_guard<std::mutex>;

constexpr int ORIENT_MACRO = 1133;     // M119 reads its angle from it (Dunwoody 6.2)
constexpr double ORIENT_STEPS = 4096;  // of one turn
constexpr double ORIENT_SPEED = 20.0;  // [rad/s] about 190 rpm, as spindles orient
constexpr double MM_PER_MIN = units::MM / 60.0;
constexpr double TRAVEL_TOLERANCE = 1e-9;  // [m] rounding of decimal input

constexpr int PS_FEED_ZERO = 11;
constexpr int PS_ORIENTATION = 114;
constexpr int PS_VARIABLE_NUMBER = 115;
constexpr int PS_BLOCK_TOO_LONG = 3;
constexpr int OT_PLUS = 500;
constexpr int OT_MINUS = 501;

bool macroExists(int number) {
  return (number >= 100 && number <= 199) || (number >= 500 && number <= 999) || number == ORIENT_MACRO;
}

std::vector<double> inMm(const std::array<double, 3>& v) {
  return {v[0] / units::MM, v[1] / units::MM, v[2] / units::MM};
}

std::string numberText(double value) {
  return std::to_string(value);
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
  return options;
}

focas::SysInfo ControllerOptions::fineInfo() {
  focas::SysInfo info;
  info.position_decimals = 4;
  return info;
}

void ControllerOptions::validate() const {
  const auto positive = [](const char* key, double value) {
    if (!(value > 0.0) || !std::isfinite(value)) {
      throw Error(std::string("controller: ") + key + " is " + numberText(value) + ", above 0 is due");
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
  if (buffer_size == 0) {
    throw Error("controller: buffer_size is 0 bytes");
  }
}

/// Everything under one lock; the outer class locks, this one does not.
class Controller::Impl {
 public:
  explicit Impl(const ControllerOptions& o)
      : options(o), mode(o.mode), move_(o.axes.home), spindle_(o.spindle_acceleration) {}

  mutable std::mutex mutex;
  const ControllerOptions options;
  int mode;
  bool emergency = false;
  double spindle_load = 0.0;                    // [percent]
  std::array<double, 3> servo_load{{0, 0, 0}};  // [percent]
  std::vector<focas::AlarmMessage> alarms;
  std::map<int, double> macros;  // those not vacant
  int sequence = 0, blocks = 0;
  std::string block_text;

  // Time.

  void step(double dt) {
    if (dt != dt_) {
      base_ = now_;
      dt_ = dt;
      steps_ = 0;
    }
    // A product, not a sum: rounding does not add up.
    const double end = base_ + static_cast<double>(++steps_) * dt_;
    double time = now_;
    while (running_ || takeBlock(time)) {
      if (running_ && wait_until_ > end) {
        break;
      }
      if (running_) {
        time = std::max(time, wait_until_);
        goOn(time);
      }
    }
    now_ = end;
  }

  MotionState motion() const {
    return {position(), move_.velocity(now_ - move_start_), spindle_.angle(now_), spindle_.speed(now_)};
  }

  // What the screen shows.

  std::array<double, 3> position() const { return move_.position(now_ - move_start_); }
  double speed() const { return move_.speed(now_ - move_start_); }
  double spindleSpeed() const { return spindle_.speed(now_); }
  bool moving() const { return now_ < move_start_ + move_.duration(); }
  std::array<double, 3> distanceToGo() const {
    std::array<double, 3> left = move_.target();
    const std::array<double, 3> at = position();
    for (std::size_t i = 0; i < 3; ++i) {
      left[i] -= at[i];
    }
    return left;
  }

  focas::Status status() const {
    focas::Status status;
    status.aut = static_cast<std::int16_t>(mode);
    status.run = busy() ? focas::RUN_START : session_ ? focas::RUN_STOP : focas::RUN_RESET;
    status.motion = moving()                                         ? focas::MOTION_MOVES
                    : running_ && block_.dwell && now_ < wait_until_ ? focas::MOTION_DWELL
                                                                     : focas::MOTION_NONE;
    status.emergency = emergency ? 1 : 0;
    status.alarm = alarms.empty() ? 0 : 1;
    return status;
  }

  // The operator and the DNC session.

  /// Blocks are running or waiting.
  bool busy() const { return running_ || text_.find_first_of("\r\n") != std::string::npos; }

  /// Stops everything from the end of the last step on.
  void halt(EwCode why) { haltAt(now_, why); }

  void alarm(const focas::AlarmMessage& message) {
    alarms.push_back(message);
    halt(focas::EW_ALARM);
  }

  void setMode(int aut) {
    if (mode == focas::AUT_REMOTE && aut != mode && (busy() || session_)) {
      halt(focas::EW_MODE);
    }
    mode = aut;
  }

  EwCode open() {
    if (emergency || !alarms.empty()) {
      return focas::EW_ALARM;
    }
    if (mode != focas::AUT_REMOTE) {
      return focas::EW_MODE;
    }
    if (session_ || busy() || moving()) {
      return focas::EW_BUSY;
    }
    session_ = true;
    abort_ = focas::EW_OK;
    beginProgram();
    return focas::EW_OK;
  }

  std::size_t take(const char* data, std::size_t size) {
    if (!session_) {
      return size;  // of a session that has ended: thrown away
    }
    const std::size_t taken =
        std::min(size, options.buffer_size - std::min(options.buffer_size, text_.size()));
    text_.append(data, taken);
    return taken;
  }

  EwCode end() {
    if (abort_ != focas::EW_OK) {
      return abort();
    }
    if (!session_) {
      return focas::EW_FUNC;
    }
    session_ = false;
    if (!text_.empty()) {
      text_ += '\n';
    }
    return focas::EW_OK;
  }

  void cancel() {
    session_ = false;
    halt(focas::EW_OK);
  }

  EwCode abort() { return std::exchange(abort_, focas::EW_OK); }

 private:
  void haltAt(double time, EwCode why) {
    const double since = time - move_start_;
    if (since < move_.duration()) {
      move_ = StraightMove::brake(move_.position(since), move_.velocity(since), options.axes.acceleration);
      move_start_ = time;
    }
    spindle_.ramp(time, 0.0);
    spindle_on_ = false;
    running_ = false;
    text_.clear();
    block_text.clear();
    if (session_) {
      session_ = false;
      abort_ = why;
    }
  }

  void beginProgram() {
    relative_ = false;
    rapid_ = false;
    feed_ = 0.0;
    commanded_speed_ = 0.0;
  }

  /// Starts the next block at a time. @return whether there was one (or an alarm).
  bool takeBlock(double time) {
    const std::size_t end = text_.find_first_of("\r\n");
    if (end == std::string::npos && text_.size() < options.buffer_size) {
      return false;
    }
    try {
      if (end == std::string::npos) {
        throw NcAlarm(PS_BLOCK_TOO_LONG, ALARM_PS, "BLOCK LONGER THAN THE BUFFER");
      }
      block_text = text_.substr(0, end);
      text_.erase(0, end + 1);
      if (block_text.empty()) {
        return true;
      }
      start(time, parseBlock(block_text));
    } catch (const NcAlarm& e) {
      refuse(time, e);
    }
    return true;
  }

  void refuse(double time, const NcAlarm& e) {
    alarms.push_back({e.number(), e.type(), e.axis(), std::string(e.what()) + ": " + block_text});
    haltAt(time, focas::EW_ALARM);
  }

  void start(double time, const NcBlock& block) {
    sequence = block.sequence.value_or(sequence);
    relative_ = block.relative.value_or(relative_);
    rapid_ = block.motion ? *block.motion == 0 : rapid_;
    feed_ = block.feed.value_or(feed_);
    if (block.macro) {
      if (!macroExists(*block.macro)) {
        throw NcAlarm(PS_VARIABLE_NUMBER, ALARM_PS, "VARIABLE NO. OUT OF RANGE");
      }
      macros[*block.macro] = block.macro_value;
    }
    const StraightMove next = block.moves() ? moveOf(block) : move_;
    if (block.speed) {
      commanded_speed_ = std::min(units::radPerSecFromRpm(*block.speed), options.spindle_max_speed);
    }
    spindle_on_ = spindle_on_ || block.m_code == 3;
    if (spindle_on_ && (block.speed || block.m_code == 3)) {
      spindle_.ramp(time, commanded_speed_);
    }
    wait_until_ = time + block.dwell.value_or(0.0);
    if (block.moves()) {
      move_ = next;
      move_start_ = time;
      wait_until_ = time + move_.duration();
    }
    block_ = block;
    running_ = true;
    ++blocks;
  }

  StraightMove moveOf(const NcBlock& block) const {
    const std::array<double, 3> from = move_.target();
    std::array<double, 3> to = from;
    for (std::size_t i = 0; i < 3; ++i) {
      if (!block.axis[i]) {
        continue;
      }
      to[i] = *block.axis[i] * units::MM + (relative_ ? from[i] : options.work_offset[i]);
      const auto& travel = options.axes.travel[i];
      if (to[i] > travel[1] + TRAVEL_TOLERANCE || to[i] < travel[0] - TRAVEL_TOLERANCE) {
        const bool plus = to[i] > travel[1];
        throw NcAlarm(plus ? OT_PLUS : OT_MINUS, ALARM_OT,
                      std::string(plus ? "(+)" : "(-)") + " OVERTRAVEL " + "XYZ"[i], static_cast<int>(i) + 1);
      }
    }
    const double feed = rapid_ ? options.axes.rapid : std::min(feed_ * MM_PER_MIN, options.axes.rapid);
    if (feed <= 0.0) {
      throw NcAlarm(PS_FEED_ZERO, ALARM_PS, "FEED ZERO (COMMAND)");
    }
    return StraightMove(from, to, feed, options.axes.acceleration);
  }

  /// What the block waited for has come: its M word that comes after the motion, or its end.
  void goOn(double time) {
    const int m_code = block_.m_code.value_or(0);
    block_.m_code.reset();
    if (m_code == 5 || m_code == 30 || m_code == 2) {
      spindle_.ramp(time, 0.0);
      spindle_on_ = false;
    } else if (m_code == 119) {
      orient(time);
    } else {
      running_ = false;
      block_text.clear();
    }
    if (m_code == 30 || m_code == 2) {
      beginProgram();
    }
    wait_until_ = spindle_.settled();
  }

  void orient(double time) {
    const auto found = macros.find(ORIENT_MACRO);
    if (found == macros.end() || !(found->second >= 0.0 && found->second <= ORIENT_STEPS - 1)) {
      refuse(time, NcAlarm(PS_ORIENTATION, ALARM_PS, "#1133 IS NOT 0 TO 4095"));
      return;
    }
    spindle_on_ = false;
    spindle_.orient(time, units::TWO_PI * found->second / ORIENT_STEPS, ORIENT_SPEED);
  }

  // Time is base_ + steps_ dt_ [s].
  double now_ = 0.0, base_ = 0.0, dt_ = 0.0;
  std::uint64_t steps_ = 0;

  StraightMove move_;  // the last one, maybe over
  double move_start_ = 0.0;
  SpindleMotion spindle_;
  bool spindle_on_ = false;

  // Modal state of the program.
  bool relative_ = false, rapid_ = false;
  double feed_ = 0.0;             // [mm/min]
  double commanded_speed_ = 0.0;  // [rad/s]

  bool session_ = false;
  EwCode abort_ = focas::EW_OK;  // why the session ended, not yet told
  std::string text_;             // not yet run
  bool running_ = false;
  NcBlock block_;            // the running one
  double wait_until_ = 0.0;  // [s] it goes on then
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
    impl_->step(dt);
    state = impl_->motion();
  }
}

MotionState Controller::motion() const {
  const Lock lock(impl_->mutex);
  return impl_->motion();
}

void Controller::setSpindleLoad(double percent) {
  const Lock lock(impl_->mutex);
  impl_->spindle_load = percent;
}

void Controller::setServoLoad(const std::array<double, 3>& percent) {
  const Lock lock(impl_->mutex);
  impl_->servo_load = percent;
}

void Controller::setMode(int aut) {
  const Lock lock(impl_->mutex);
  impl_->setMode(aut);
}

void Controller::raiseAlarm(int number, const std::string& text) {
  const Lock lock(impl_->mutex);
  impl_->alarm({number, ALARM_EX, 0, text});
}

void Controller::emergency(bool on) {
  const Lock lock(impl_->mutex);
  impl_->emergency = on;
  if (on) {
    impl_->halt(focas::EW_ALARM);
  }
}

focas::SysInfo Controller::sysInfo() const {
  return impl_->options.info;
}

focas::Status Controller::status() const {
  const Lock lock(impl_->mutex);
  return impl_->status();
}

std::vector<double> Controller::machinePosition() const {
  const Lock lock(impl_->mutex);
  return inMm(impl_->position());
}

std::vector<double> Controller::absolutePosition() const {
  const Lock lock(impl_->mutex);
  std::array<double, 3> position = impl_->position();
  for (std::size_t i = 0; i < 3; ++i) {
    position[i] -= impl_->options.work_offset[i];
  }
  return inMm(position);
}

std::vector<double> Controller::relativePosition() const {
  return absolutePosition();
}

std::vector<double> Controller::distanceToGo() const {
  const Lock lock(impl_->mutex);
  return inMm(impl_->distanceToGo());
}

double Controller::actualFeed() const {
  const Lock lock(impl_->mutex);
  return impl_->speed() / MM_PER_MIN;
}

std::vector<double> Controller::spindleSpeed() const {
  const Lock lock(impl_->mutex);
  return {units::rpmFromRadPerSec(impl_->spindleSpeed())};
}

std::vector<double> Controller::spindleLoad() const {
  const Lock lock(impl_->mutex);
  return {impl_->spindle_load};
}

std::vector<double> Controller::spindleMaxSpeed() const {
  return {units::rpmFromRadPerSec(impl_->options.spindle_max_speed)};
}

std::vector<double> Controller::servoLoad() const {
  const Lock lock(impl_->mutex);
  return {impl_->servo_load.begin(), impl_->servo_load.end()};
}

EwCode Controller::readMacro(int number, std::optional<double>* value) const {
  if (!macroExists(number)) {
    return focas::EW_NUMBER;
  }
  const Lock lock(impl_->mutex);
  const auto found = impl_->macros.find(number);
  *value = found == impl_->macros.end() ? std::nullopt : std::optional<double>(found->second);
  return focas::EW_OK;
}

EwCode Controller::writeMacro(int number, std::optional<double> value) {
  if (!macroExists(number)) {
    return focas::EW_NUMBER;
  }
  const Lock lock(impl_->mutex);
  if (value) {
    impl_->macros[number] = *value;
  } else {
    impl_->macros.erase(number);
  }
  return focas::EW_OK;
}

std::uint32_t Controller::alarmBits() const {
  const Lock lock(impl_->mutex);
  std::uint32_t bits = 0;
  for (const focas::AlarmMessage& alarm : impl_->alarms) {
    bits |= 1U << static_cast<unsigned>(alarm.type);
  }
  return bits;
}

std::vector<focas::AlarmMessage> Controller::alarmMessages() const {
  const Lock lock(impl_->mutex);
  return impl_->alarms;
}

int Controller::runningProgram() const {
  return 0;
}

int Controller::mainProgram() const {
  return 0;
}

int Controller::sequenceNumber() const {
  const Lock lock(impl_->mutex);
  return impl_->sequence;
}

int Controller::blockCount() const {
  const Lock lock(impl_->mutex);
  return impl_->blocks;
}

std::string Controller::programPath() const {
  return "";
}

std::string Controller::executingBlock() const {
  const Lock lock(impl_->mutex);
  return impl_->block_text;
}

EwCode Controller::reset() {
  const Lock lock(impl_->mutex);
  impl_->halt(focas::EW_RESET);
  impl_->alarms.clear();
  return focas::EW_OK;
}

EwCode Controller::dncStart() {
  const Lock lock(impl_->mutex);
  return impl_->open();
}

std::size_t Controller::dncData(const char* data, std::size_t size) {
  const Lock lock(impl_->mutex);
  return impl_->take(data, size);
}

EwCode Controller::dncEnd() {
  const Lock lock(impl_->mutex);
  return impl_->end();
}

void Controller::dncCancel(int /*result*/) {
  const Lock lock(impl_->mutex);
  impl_->cancel();
}

EwCode Controller::dncAbort() {
  const Lock lock(impl_->mutex);
  return impl_->abort();
}

}  // namespace smartmill::sim
