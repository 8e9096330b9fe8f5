#include "controller/machine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "controller/nc_reader.h"
#include "smartmill_core/units.h"

namespace smartmill::sim {
namespace {

using focas::EwCode;

constexpr double ORIENT_STEPS = 4096;  // per revolution
constexpr double ORIENT_SPEED = 20.0;  // [rad/s] about 190 rpm, typical of spindles
constexpr double MINUTE = 60.0;        // [s]
constexpr double INCH = 25.4 * units::MM;
constexpr double TRAVEL_TOLERANCE = 1e-9;  // [m] rounding of decimal input
constexpr double ARC_TOLERANCE = 20e-6;    // [m] difference of the start and end radius
constexpr double CHECK_PERIOD = 2e-3;      // [s] between two checks of the obstacles
constexpr double AT_SPEED = 0.05;          // [1] tolerance, relative to the commanded speed
constexpr std::size_t TEXT_AHEAD = 4096;   // [byte] of the indicated program text
constexpr double NEVER = std::numeric_limits<double>::infinity();

constexpr int PS_BLOCK_TOO_LONG = 3;
constexpr int PS_FEED_ZERO = 11;
constexpr int PS_ARC = 20;  // end point not on the arc
constexpr int PS_VARIABLE_NUMBER = 115;
constexpr int PS_VARIABLE_READ_ONLY = 116;
constexpr int OT_PLUS = 500;
constexpr int OT_MINUS = 501;
constexpr int EX_COLLISION = 3003;

constexpr const char* RESIDENT_PROGRAM = "O0001(PARK)\nG21 G90 G94\nG53 G0 Z0\nM5\nG53 G0 X0 Y0\nM30\n";

}  // namespace

void BlockBuffer::append(const char* text, std::size_t size) {
  if (position_ > 0 && position_ >= text_.size() / 2) {
    text_.erase(0, position_);
    position_ = 0;
  }
  text_.append(text, size);
}

void BlockBuffer::clear() {
  text_.clear();
  position_ = 0;
}

std::optional<std::string> BlockBuffer::takeLine() {
  const std::size_t end = text_.find_first_of("\r\n", position_);
  if (end == std::string::npos) {
    return std::nullopt;
  }
  std::string line = text_.substr(position_, end - position_);
  position_ = end + 1;
  return line;
}

ControlledMachine::ControlledMachine(const ControllerOptions& o)
    : options(o), mode_(o.mode), move_(o.axes.home), spindle_(o.spindle_acceleration) {
  variables.offsets[0] = o.work_offset;
  // Every control has programs in its memory; the selected one parks the machine.
  memory.store(RESIDENT_PROGRAM, 0, focas::DateTime());
  main_program_ = 1;
}

void ControlledMachine::step(double dt) {
  if (dt != dt_) {
    base_ = now_;
    dt_ = dt;
    steps_ = 0;
  }
  // A product instead of a sum: rounding errors do not accumulate.
  const double end = base_ + static_cast<double>(++steps_) * dt_;
  double time = now_;
  while (!held_ && !stopped_ && (running_ || takeBlock(time))) {
    if (running_ && wait_until_ > end) {
      break;
    }
    if (running_) {
      time = std::max(time, wait_until_);
      continueBlock(time);
    }
  }
  now_ = end;
  if (now_ - checked_ >= CHECK_PERIOD) {
    checkCollision();
  }
}

void ControlledMachine::checkCollision() {
  checked_ = now_;
  const bool turning = spindle_.speed(now_) != 0.0;
  if (!moving() && !turning) {
    return;
  }
  if (const CollisionWatch::Body* body = options.obstacles.collidingBody(position(), turning)) {
    if (alarms.empty()) {
      alarm({EX_COLLISION, ALARM_EX, 0, "TOOL MET " + body->name});
    }
  }
}

MotionState ControlledMachine::motion() const {
  return {position(), velocity(), spindle_.angle(now_), spindle_.speed(now_), sequence};
}

std::array<double, 3> ControlledMachine::workPosition() const {
  std::array<double, 3> at = position();
  for (std::size_t i = 0; i < 3; ++i) {
    at[i] -= variables.offsets[modal_.work][i];
  }
  return at;
}

std::array<double, 3> ControlledMachine::distanceToGo() const {
  std::array<double, 3> remaining = pending_.empty() ? move_.target() : pending_.back().move.target();
  const std::array<double, 3> at = position();
  for (std::size_t i = 0; i < 3; ++i) {
    remaining[i] -= at[i];
  }
  return remaining;
}

focas::Status ControlledMachine::status() const {
  focas::Status status;
  status.aut = static_cast<std::int16_t>(mode_);
  const bool started = busy() && !stopped_;
  status.run = held_                  ? focas::RUN_HOLD
               : started              ? focas::RUN_START
               : session_ || stopped_ ? focas::RUN_STOP
                                      : focas::RUN_RESET;
  status.motion = moving() ? focas::MOTION_MOVES : dwells() ? focas::MOTION_DWELL : focas::MOTION_NONE;
  status.mstb = running_ && block_.m_code && !moving() ? 1 : 0;
  status.emergency = emergency_ ? 1 : 0;
  status.alarm = alarms.empty() ? 0 : 1;
  return status;
}

std::string ControlledMachine::programText() const {
  if (running_ || session_ || from_memory_) {
    const std::string preview = buffer_.preview(TEXT_AHEAD);
    return block_text.empty() ? preview : block_text + "\n" + preview;
  }
  return memory.text(main_program_).value_or("");
}

PmcSignals ControlledMachine::signals() const {
  PmcSignals s;
  const double speed = spindle_.speed(now_);
  s.mode = mode_;
  s.operating = busy() || session_;
  s.started = busy() && !held_ && !stopped_;
  s.held = held_;
  s.alarm = !alarms.empty();
  s.emergency = emergency_;
  s.at_rest = speed == 0.0;
  s.at_speed = rotation_ != Rotation::off &&
               std::abs(speed - commandedSpeed()) <= AT_SPEED * std::abs(commandedSpeed());
  s.oriented = oriented_ && speed == 0.0 && now_ >= spindle_.settleTime();
  s.m_code = last_m_;
  s.s_code = static_cast<int>(std::lround(units::rpmFromRadPerSec(modal_.speed)));
  s.spindle_speed = units::rpmFromRadPerSec(speed);
  s.feed_override = feed_override_ * data_feed_override_;
  s.spindle_override = spindle_override_ * data_spindle_override_;
  return s;
}

// --- the operator

void ControlledMachine::halt(EwCode why) {
  haltAt(now_, why);
}

void ControlledMachine::haltAt(double time, EwCode why) {
  if (time < move_.end()) {
    move_.stop(time, options.axes.acceleration);
  } else if (move_.held()) {
    move_ = PathMove(move_.position(time));  // at rest in feed hold: the rest of its path is dropped
  }
  pending_.clear();
  spindle_.ramp(time, 0.0);
  rotation_ = Rotation::off;
  running_ = held_ = stopped_ = from_memory_ = false;
  running_program_ = 0;
  buffer_.clear();
  block_text.clear();
  if (session_) {
    session_ = false;
    abort_ = why;
  }
}

void ControlledMachine::alarm(const focas::AlarmMessage& message) {
  alarms.push_back(message);
  halt(focas::EW_ALARM);
}

void ControlledMachine::setMode(int aut) {
  if (aut != mode_ && (busy() || session_ || held_ || stopped_)) {
    halt(focas::EW_MODE);
  }
  mode_ = aut;
}

void ControlledMachine::emergency(bool on) {
  emergency_ = on;
  if (on) {
    halt(focas::EW_ALARM);
  }
}

void ControlledMachine::reset() {
  halt(focas::EW_RESET);
  alarms.clear();
  variables.clearLocals();
}

void ControlledMachine::feedHold() {
  if (held_ || !busy()) {
    return;
  }
  held_ = true;
  held_since_ = now_;
  if (moving()) {
    move_.plan(now_, 0.0, options.axes.acceleration);
  }
}

void ControlledMachine::updateDataTableOverrides() {
  focas::Bytes bytes;
  pmc.read(focas::PmcArea::d, OVERRIDE_DATA, OVERRIDE_DATA + 1, &bytes);
  const auto share = [](std::uint8_t percent) { return percent == 0 ? 1.0 : 0.01 * percent; };
  data_feed_override_ = share(bytes[0]);
  if (share(bytes[1]) != data_spindle_override_) {
    data_spindle_override_ = share(bytes[1]);
    if (rotation_ != Rotation::off) {
      spindle_.ramp(now_, commandedSpeed());
    }
  }
  if (!held_) {
    replan();
  }
}

void ControlledMachine::setOverrides(double feed, double rapid, double spindle) {
  feed_override_ = feed;
  rapid_override_ = rapid;
  if (spindle != spindle_override_) {
    spindle_override_ = spindle;
    if (rotation_ != Rotation::off) {
      spindle_.ramp(now_, commandedSpeed());
    }
  }
  if (!held_) {
    replan();
  }
}

/// Replans the running move for the present overrides.
void ControlledMachine::replan() {
  if (running_ && (moving() || move_.held())) {
    move_.plan(now_, feedOf(move_, move_rapid_), options.axes.acceleration);
    wait_until_ = move_.held() ? NEVER : move_.end();
  }
}

EwCode ControlledMachine::cycleStart() {
  if (emergency_ || !alarms.empty()) {
    return focas::EW_ALARM;
  }
  if (mode_ != focas::AUT_MEM && mode_ != focas::AUT_REMOTE) {
    return focas::EW_MODE;
  }
  if (held_) {
    held_ = false;
    if (running_ && block_.dwell) {
      wait_until_ += now_ - held_since_;
    }
    replan();
    return focas::EW_OK;
  }
  if (std::exchange(stopped_, false) || busy() || mode_ == focas::AUT_REMOTE) {
    return focas::EW_OK;
  }
  const std::optional<std::string> text = memory.text(main_program_);
  if (!text) {
    return focas::EW_DATA;
  }
  beginProgram();
  from_memory_ = true;
  buffer_.append(text->data(), text->size());
  return focas::EW_OK;
}

void ControlledMachine::setSpindleTorque(double torque) {
  if (options.spindle_torque <= 0.0 || torque == torque_) {
    return;
  }
  torque_ = torque;
  // The drive's torque limit accelerates the inertia and carries the cut; the cut assists braking.
  const double share = torque / options.spindle_torque;
  const double drive = options.spindle_acceleration;
  spindle_.setAccelerations(now_, drive * (1.0 - share), drive * std::max(1.0 + share, 0.01));
}

// --- the DNC session

EwCode ControlledMachine::openSession() {
  if (emergency_ || !alarms.empty()) {
    return focas::EW_ALARM;
  }
  if (mode_ != focas::AUT_REMOTE) {
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

std::size_t ControlledMachine::receive(const char* data, std::size_t size) {
  if (!session_) {
    return size;  // data of a closed session is discarded
  }
  const std::size_t taken =
      std::min(size, options.buffer_size - std::min(options.buffer_size, buffer_.size()));
  buffer_.append(data, taken);
  return taken;
}

EwCode ControlledMachine::closeSession() {
  if (abort_ != focas::EW_OK) {
    return takeAbortCode();
  }
  if (!session_) {
    return focas::EW_FUNC;
  }
  session_ = false;
  if (buffer_.size() > 0) {
    buffer_.append("\n", 1);
  }
  return focas::EW_OK;
}

void ControlledMachine::cancelSession() {
  session_ = false;
  halt(focas::EW_OK);
}

EwCode ControlledMachine::takeAbortCode() {
  return std::exchange(abort_, focas::EW_OK);
}

// --- memory

std::optional<double> ControlledMachine::readVariable(int number) const {
  return variables.read(number, {pending_.empty() ? move_.target() : pending_.back().move.target(),
                                 position(), workPosition()});
}

EwCode ControlledMachine::select(int number) {
  if (!memory.has(number)) {
    return focas::EW_DATA;
  }
  if (from_memory_) {
    return focas::EW_BUSY;
  }
  main_program_ = number;
  return focas::EW_OK;
}

EwCode ControlledMachine::erase(int number) {
  if (!memory.has(number)) {
    return focas::EW_DATA;
  }
  if (from_memory_ && number == main_program_) {
    return focas::EW_BUSY;
  }
  memory.erase(number);
  main_program_ = number == main_program_ ? 0 : main_program_;
  return focas::EW_OK;
}

EwCode ControlledMachine::store(const std::string& text, const focas::DateTime& now) {
  return memory.store(text, from_memory_ ? main_program_ : 0, now);
}

// --- blocks

void ControlledMachine::beginProgram() {
  modal_ = Modal();
  running_program_ = mode_ == focas::AUT_MEM ? main_program_ : 0;
  variables.clearLocals();
}

/// Starts the next block at a time [s]. @return whether there was one (or an alarm).
bool ControlledMachine::takeBlock(double time) {
  try {
    const std::optional<std::string> line = buffer_.takeLine();
    if (!line) {
      from_memory_ = false;
      if (buffer_.size() < options.buffer_size) {
        return false;
      }
      throw NcAlarm(PS_BLOCK_TOO_LONG, ALARM_PS, "BLOCK LONGER THAN THE BUFFER");
    }
    block_text = *line;
    if (!block_text.empty()) {
      start(time, parseBlock(block_text, [this](int number) {
              if (number != Variables::VACANT && !Variables::exists(number)) {
                throw NcAlarm(PS_VARIABLE_NUMBER, ALARM_PS, "VARIABLE NO. OUT OF RANGE");
              }
              return readVariable(number);
            }));
    }
  } catch (const NcAlarm& e) {
    raiseProgramAlarm(time, e);
  }
  return true;
}

void ControlledMachine::raiseProgramAlarm(double time, const NcAlarm& e) {
  alarms.push_back({e.number(), e.type(), e.axis(), std::string(e.what()) + ": " + block_text});
  haltAt(time, focas::EW_ALARM);
}

void ControlledMachine::start(double time, const NcBlock& block) {
  running_program_ = block.program.value_or(running_program_);
  sequence = block.sequence.value_or(sequence);
  modal_.relative = block.relative.value_or(modal_.relative);
  modal_.inch = block.inch.value_or(modal_.inch);
  modal_.per_turn = block.per_turn.value_or(modal_.per_turn);
  modal_.work = static_cast<std::size_t>(block.work.value_or(static_cast<int>(modal_.work)));
  modal_.motion = block.motion.value_or(modal_.motion);
  modal_.feed = block.feed.value_or(modal_.feed);
  if (block.macro) {
    if (!Variables::writable(*block.macro)) {
      const bool there = Variables::exists(*block.macro);
      throw NcAlarm(there ? PS_VARIABLE_READ_ONLY : PS_VARIABLE_NUMBER, ALARM_PS,
                    there ? "WRITE PROTECTED VARIABLE" : "VARIABLE NO. OUT OF RANGE");
    }
    variables.write(*block.macro, block.macro_value);
  }
  startSpindle(time, block);
  const bool circle = modal_.motion >= 2 && (block.centre[0] || block.centre[1]);
  if (block.moves() || circle) {
    planPath(block);
  }
  block_ = block;
  running_ = true;
  ++blocks;
  wait_until_ = time + block.dwell.value_or(0.0);
  if (!pending_.empty()) {
    beginMove(time);
  }
}

double ControlledMachine::commandedSpeed() const {
  const double speed =
      std::min(modal_.speed * spindle_override_ * data_spindle_override_, options.spindle_max_speed);
  return rotation_ == Rotation::backwards ? -speed : speed;
}

void ControlledMachine::startSpindle(double time, const NcBlock& block) {
  if (block.speed) {
    modal_.speed = std::min(units::radPerSecFromRpm(*block.speed), options.spindle_max_speed);
  }
  const int m_code = block.m_code.value_or(0);
  const bool begins = m_code == 3 || m_code == 4;
  if (begins) {
    rotation_ = m_code == 3 ? Rotation::forwards : Rotation::backwards;
    oriented_ = false;
    last_m_ = m_code;
  }
  if (rotation_ != Rotation::off && (block.speed || begins)) {
    spindle_.ramp(time, commandedSpeed());
  }
}

double ControlledMachine::unit() const {
  return modal_.inch ? INCH : units::MM;
}

std::array<double, 3> ControlledMachine::targetOf(const NcBlock& block,
                                                  const std::array<double, 3>& from) const {
  std::array<double, 3> to = from;
  for (std::size_t i = 0; i < 3; ++i) {
    if (!block.axis[i]) {
      continue;
    }
    const double zero = block.machine ? 0.0 : modal_.relative ? from[i] : variables.offsets[modal_.work][i];
    to[i] = *block.axis[i] * unit() + zero;
  }
  return to;
}

void ControlledMachine::planPath(const NcBlock& block) {
  const std::array<double, 3> from = move_.target();
  const std::array<double, 3> to = targetOf(block, from);
  pending_.clear();
  if (block.reference) {
    // Through the programmed point to the reference position of the named axes.
    std::array<double, 3> home = to;
    for (std::size_t i = 0; i < 3; ++i) {
      home[i] = block.axis[i] ? options.axes.home[i] : to[i];
    }
    append(PathMove::line(from, to), true);
    append(PathMove::line(to, home), true);
  } else if (modal_.motion >= 2 && !block.machine && !(block.radius && from == to)) {
    const bool clockwise = modal_.motion == 2;
    append(PathMove::arc(from, to, centreOf(block, from, to), clockwise), false);
  } else {
    // Machine coordinates are approached in rapid traverse in any motion mode; a radius arc that ends at its
    // start is no motion.
    append(PathMove::line(from, to), modal_.motion == 0 || block.machine);
  }
}

std::array<double, 2> ControlledMachine::centreOf(const NcBlock& block, const std::array<double, 3>& from,
                                                  const std::array<double, 3>& to) const {
  if (block.radius) {
    // Two circles pass through start and end; a positive R selects the shorter arc.
    const double r = *block.radius * unit();
    const double dx = to[0] - from[0], dy = to[1] - from[1], chord = std::hypot(dx, dy);
    const double square = r * r - 0.25 * chord * chord;
    if (chord == 0.0 || square < -ARC_TOLERANCE * std::abs(r)) {
      throw NcAlarm(PS_ARC, ALARM_PS, "OVER TOLERANCE OF RADIUS");
    }
    const double side = (modal_.motion == 2) == (r > 0.0) ? 1.0 : -1.0;
    const double height = side * std::sqrt(std::max(0.0, square)) / chord;
    return {from[0] + 0.5 * dx + height * dy, from[1] + 0.5 * dy - height * dx};
  }
  if (!block.centre[0] && !block.centre[1]) {
    throw NcAlarm(PS_ARC, ALARM_PS, "NO RADIUS COMMANDED");
  }
  const std::array<double, 2> centre{from[0] + block.centre[0].value_or(0.0) * unit(),
                                     from[1] + block.centre[1].value_or(0.0) * unit()};
  const double begin = std::hypot(from[0] - centre[0], from[1] - centre[1]);
  const double end = std::hypot(to[0] - centre[0], to[1] - centre[1]);
  if (begin == 0.0 || std::abs(begin - end) > ARC_TOLERANCE) {
    throw NcAlarm(PS_ARC, ALARM_PS, "OVER TOLERANCE OF RADIUS");
  }
  return centre;
}

void ControlledMachine::checkTravel(const PathMove& move) const {
  const auto extent = move.extent();
  for (std::size_t i = 0; i < 3; ++i) {
    const double low = i < 2 ? extent[i][0] : move.target()[2];
    const double high = i < 2 ? extent[i][1] : move.target()[2];
    const auto& travel = options.axes.travel[i];
    if (high > travel[1] + TRAVEL_TOLERANCE || low < travel[0] - TRAVEL_TOLERANCE) {
      const bool plus = high > travel[1] + TRAVEL_TOLERANCE;
      throw NcAlarm(plus ? OT_PLUS : OT_MINUS, ALARM_OT,
                    std::string(plus ? "(+)" : "(-)") + " OVERTRAVEL " + "XYZ"[i], static_cast<int>(i) + 1);
    }
  }
}

void ControlledMachine::append(const PathMove& move, bool rapid) {
  try {
    checkTravel(move);
    if (!rapid && modal_.feed <= 0.0) {
      throw NcAlarm(PS_FEED_ZERO, ALARM_PS, "FEED ZERO (COMMAND)");
    }
    if (!rapid && modal_.per_turn && commandedSpeed() == 0.0) {
      throw NcAlarm(PS_FEED_ZERO, ALARM_PS, "FEED PER TURN WITHOUT SPINDLE");
    }
  } catch (const NcAlarm&) {
    pending_.clear();
    throw;
  }
  pending_.push_back({move, rapid});
}

/// Feed [m/s], limited by override, rapid traverse and the centripetal acceleration of a curve.
double ControlledMachine::feedOf(const PathMove& move, bool rapid) const {
  if (rapid) {
    return options.axes.rapid * rapid_override_;
  }
  double feed = modal_.feed * unit() / MINUTE;
  if (modal_.per_turn) {
    feed = modal_.feed * unit() * std::abs(commandedSpeed()) / units::TWO_PI;
  }
  return std::min({feed * feed_override_ * data_feed_override_, options.axes.rapid,
                   move.curveFeed(options.axes.acceleration).value_or(options.axes.rapid)});
}

void ControlledMachine::beginMove(double time) {
  move_ = pending_.front().move;
  move_rapid_ = pending_.front().rapid;
  pending_.pop_front();
  move_.plan(time, feedOf(move_, move_rapid_), options.axes.acceleration);
  wait_until_ = move_.held() ? NEVER : move_.end();
}

/// Begins the next segment of the block's path, if any.
bool ControlledMachine::beginNextMove(double time) {
  if (pending_.empty()) {
    return false;
  }
  beginMove(time);
  return true;
}

/// The wait of the block is over: its next segment, its M word after the motion, or its end.
void ControlledMachine::continueBlock(double time) {
  if (beginNextMove(time)) {
    return;
  }
  const int m_code = block_.m_code.value_or(-1);
  block_.m_code.reset();
  last_m_ = m_code >= 0 ? m_code : last_m_;
  if (m_code == 5 || m_code == 30 || m_code == 2) {
    spindle_.ramp(time, 0.0);
    rotation_ = Rotation::off;
  } else if (m_code == 19 || m_code == 119) {
    orient(time, m_code == 19 ? 0.0 : readVariable(Variables::ORIENT).value_or(-1.0));
  } else {
    running_ = false;
    stopped_ = m_code == 0;
    block_text.clear();
  }
  if (m_code == 30 || m_code == 2) {
    beginProgram();
    if (std::exchange(from_memory_, false)) {
      buffer_.clear();
    }
  }
  wait_until_ = spindle_.settleTime();
}

void ControlledMachine::orient(double time, double steps) {
  if (!(steps >= 0.0 && steps <= ORIENT_STEPS - 1)) {
    raiseProgramAlarm(time, NcAlarm(PS_MACRO_FORMAT, ALARM_PS, "#1133 IS NOT 0 TO 4095"));
    return;
  }
  rotation_ = Rotation::off;
  oriented_ = true;
  spindle_.orient(time, units::TWO_PI * steps / ORIENT_STEPS, ORIENT_SPEED);
}

}  // namespace smartmill::sim
