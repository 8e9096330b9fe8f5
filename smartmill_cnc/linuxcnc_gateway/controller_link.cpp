// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#include "controller_link.h"

#include <rcs.hh>
// LinuxCNC's headers require this order
#include <emc.hh>
#include <emc_nml.hh>
#include <nml_oi.hh>
#include <rcs_print.hh>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <thread>
#include <utility>

namespace smartmill::cnc::linuxcnc {
namespace {

using Code = Reply::Code;

constexpr std::chrono::milliseconds POLL_PERIOD{1};
constexpr std::chrono::milliseconds REATTACH{500};                               // between two attempts
constexpr double REPLY_TIMEOUT = 1.0, HOMING_TIMEOUT = 3.0, STOP_TIMEOUT = 0.3;  // [s]
constexpr std::uint32_t SETTLED = 4;  // [servo cycles] of an idle task after a program
constexpr const char* PIECE = "o<piece> call";

char* writable(const std::string& text) {
  return const_cast<char*>(text.c_str());  // NML takes char* and only reads it
}

std::array<double, 3> metres(const EmcPose& pose, double units_per_mm) {
  const double scale = units_per_mm > 0.0 ? 1e-3 / units_per_mm : 1e-3;
  return {pose.tran.x * scale, pose.tran.y * scale, pose.tran.z * scale};
}

}  // namespace

struct ControllerLink::Channels {
  explicit Channels(const std::string& file)
      : status(emcFormat, "emcStatus", "xemc", writable(file)),
        command(emcFormat, "emcCommand", "xemc", writable(file)),
        error(nmlErrorFormat, "emcError", "xemc", writable(file)) {}
  bool valid() { return status.valid() && command.valid() && error.valid(); }
  EMC_STAT& stat() { return *static_cast<EMC_STAT*>(status.get_address()); }

  RCS_STAT_CHANNEL status;
  RCS_CMD_CHANNEL command;
  NML error;
};

ControllerLink::ControllerLink(std::string nml_file, std::string program_file,
                               std::function<void()> while_waiting)
    : nml_file_(std::move(nml_file)),
      program_file_(std::move(program_file)),
      while_waiting_(std::move(while_waiting)) {
  set_rcs_print_destination(RCS_PRINT_TO_NULL);
}

ControllerLink::~ControllerLink() = default;

void ControllerLink::attach() {
  const Clock::time_point now = Clock::now();
  if (attached_ != Clock::time_point() && now - attached_ < REATTACH) {
    return;
  }
  attached_ = now;
  channels_ = std::make_unique<Channels>(nml_file_);
  if (!channels_->valid()) {
    channels_.reset();
  }
}

void ControllerLink::poll() {
  if (!channels_ || (!status_.alive && Clock::now() - attached_ > REATTACH)) {
    attach();
  }
  if (!channels_) {
    status_.alive = false;
    return;
  }
  channels_->status.peek();
  const std::uint32_t heartbeat = channels_->stat().motion.heartbeat;
  const bool beats = heartbeat != 0 && heartbeat != status_.heartbeat;
  if (beats) {
    readStatus();
    abortOrphan();
  }
  takeErrors();
  checkLiveness(beats);
  detectProgramEnd();
}

/// A program that already runs at the first contact was started through a gateway that has ended.
void ControllerLink::abortOrphan() {
  if (status_.alive && !std::exchange(contacted_, true) && status_.busy &&
      status_.mode == MachineStatus::Mode::mdi) {
    EMC_TASK_ABORT message;
    channels_->command.write(&message);
  }
}

void ControllerLink::checkLiveness(bool beats) {
  const double now = std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
  const Liveness::Verdict verdict = liveness_.update(beats, processes_, now);
  status_.starved = liveness_.starved();
  if (verdict == Liveness::Verdict::lives || !status_.alive) {
    return;
  }
  status_.alive = false;
  program_.reset();
  status_.errors =
      verdict == Liveness::Verdict::ended   ? "its task has stopped: one of its processes has ended"
      : verdict == Liveness::Verdict::hangs ? "its task has stopped: no servo cycles are counted"
                                            : "it waits for a processor of an overloaded computer";
}

void ControllerLink::readStatus() {
  const EMC_STAT& s = channels_->stat();
  const EMC_TRAJ_STAT& t = s.motion.traj;
  // The first heartbeat may be left from an ended controller; a second one confirms a running one.
  if (!status_.alive && status_.heartbeat != 0) {
    status_.alive = true;
    processes_.find({"milltask", "rtapi_app"});
  }
  status_.heartbeat = s.motion.heartbeat;
  status_.state = static_cast<MachineStatus::State>(s.task.state);
  status_.mode = static_cast<MachineStatus::Mode>(s.task.mode);
  status_.busy = s.task.interpState != EMC_TASK_INTERP_IDLE || s.task.execState != EMC_TASK_EXEC_DONE ||
                 s.status == RCS_EXEC || t.queue > 0;
  status_.held = s.task.task_paused != 0 || t.paused;
  status_.homed = true;
  for (int joint = 0; joint < t.joints; ++joint) {
    status_.homed = status_.homed && s.motion.joint[joint].homed;
  }
  status_.in_position = t.inpos;
  status_.dwell_left = s.task.delayLeft;
  status_.line = s.task.motionLine;
  status_.velocity = t.current_vel * (t.linearUnits > 0.0 ? 1e-3 / t.linearUnits : 1e-3);
  status_.position = metres(t.actualPosition, t.linearUnits);
  status_.distance_to_go = metres(t.dtg, t.linearUnits);
  const std::array<double, 3> g5x = metres(s.task.g5x_offset, t.linearUnits);
  const std::array<double, 3> g92 = metres(s.task.g92_offset, t.linearUnits);
  const std::array<double, 3> tool = metres(s.task.toolOffset, t.linearUnits);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    status_.offset[axis] = g5x[axis] + g92[axis] + tool[axis];
  }
}

/// Each message reaches only one reader: all are stored, up to the length of a frame.
void ControllerLink::takeErrors() {
  for (NMLTYPE type = channels_->error.read(); type > 0; type = channels_->error.read()) {
    const NMLmsg* message = channels_->error.get_address();
    const char* text = type == EMC_OPERATOR_ERROR_TYPE
                           ? static_cast<const EMC_OPERATOR_ERROR*>(message)->error
                       : type == NML_ERROR_TYPE ? static_cast<const NML_ERROR*>(message)->error
                                                : nullptr;
    // Notes arrive as errors and are ignored.
    if (text && std::string(text).rfind("Note:", 0) != 0 && status_.errors.size() < LONGEST_TEXT / 2) {
      std::string line(text);
      std::replace(line.begin(), line.end(), '\n', ' ');
      status_.errors += (status_.errors.empty() ? "" : "; ") + line;
    }
  }
}

/// A program has ended when the task has been idle for some cycles without an error.
void ControllerLink::detectProgramEnd() {
  if (!program_ || !status_.alive) {
    return;
  }
  const EMC_STAT& s = channels_->stat();
  const bool taken = s.echo_serial_number - *program_ >= 0;
  if (!taken || status_.busy || !status_.in_position) {
    idle_at_.reset();
  } else if (!idle_at_) {
    idle_at_ = status_.heartbeat;
  } else if (status_.heartbeat - *idle_at_ >= SETTLED) {
    program_.reset();
    if (s.status != RCS_ERROR && status_.errors.empty()) {
      status_.done = status_.running;
    }
  }
}

bool ControllerLink::waitFor(const std::function<bool()>& condition, double timeout) {
  const Clock::time_point end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(timeout));
  // poll() may find that the controller has ended and close the channels.
  while (channels_ && !condition()) {
    if (Clock::now() > end) {
      return false;
    }
    std::this_thread::sleep_for(POLL_PERIOD);
    poll();
    while_waiting_();
  }
  return channels_ != nullptr;
}

/// @return the command's serial number once the task has accepted it.
template <class NmlMessage>
std::optional<int> ControllerLink::sendCommand(NmlMessage& message) {
  if (!channels_ || channels_->command.write(&message) != 0) {
    return std::nullopt;
  }
  const int serial = message.serial_number;
  const bool taken =
      waitFor([&] { return channels_->stat().echo_serial_number - serial >= 0; }, REPLY_TIMEOUT);
  return taken ? std::optional<int>(serial) : std::nullopt;
}

/// Sends a command and waits for its completion.
template <class NmlMessage>
Reply ControllerLink::execute(NmlMessage& message, const char* what) {
  const std::optional<int> serial = sendCommand(message);
  if (!serial) {
    return {Code::lost, std::string(what) + ": the controller does not answer"};
  }
  const auto ended = [&] {
    const EMC_STAT& s = channels_->stat();
    return s.echo_serial_number - *serial > 0 || s.status != RCS_EXEC;
  };
  if (!waitFor(ended, REPLY_TIMEOUT)) {
    return {Code::not_yet, std::string(what) + ": not done within a second"};
  }
  if (channels_->stat().status == RCS_ERROR) {
    waitFor([&] { return !status_.errors.empty(); }, 0.02);
    return refusal(Code::refused, what);
  }
  return {};
}

Reply ControllerLink::refusal(Code code, const std::string& what) const {
  return {code, what + ": refused" + (status_.errors.empty() ? "" : ": " + status_.errors)};
}

Reply ControllerLink::setState(int state) {
  EMC_TASK_SET_STATE message;
  message.state = static_cast<EMC_TASK_STATE_ENUM>(state);
  return execute(message, "machine state");
}

Reply ControllerLink::setMode(int mode) {
  if (channels_ && channels_->stat().task.mode == mode) {
    return {};
  }
  EMC_TASK_SET_MODE message;
  message.mode = static_cast<EMC_TASK_MODE_ENUM>(mode);
  const Reply reply = execute(message, "mode");
  if (reply.code != Code::done) {
    return reply;
  }
  const bool changed = waitFor([&] { return channels_->stat().task.mode == mode; }, REPLY_TIMEOUT);
  return changed ? Reply{} : Reply{Code::not_yet, "the controller stays in its mode"};
}

Reply ControllerLink::makeReady() {
  status_.errors.clear();
  program_.reset();
  const Reply reset = setState(EMC_TASK_STATE_ESTOP_RESET);
  if (reset.code != Code::done) {
    return reset;
  }
  // The reply is "done" even if the emergency stop is held externally.
  if (!waitFor([&] { return status_.state != MachineStatus::State::emergency; }, REPLY_TIMEOUT)) {
    return {Code::emergency, "the emergency stop cannot be reset: it is held externally"};
  }
  const Reply on = setState(EMC_TASK_STATE_ON);
  if (on.code != Code::done) {
    return on;
  }
  if (!waitFor([&] { return status_.state == MachineStatus::State::on; }, REPLY_TIMEOUT)) {
    return {Code::refused, "the machine cannot be switched on"};
  }
  return status_.homed ? Reply{} : home();
}

Reply ControllerLink::home() {
  const Reply manual = setMode(EMC_TASK_MODE_MANUAL);
  if (manual.code != Code::done) {
    return manual;
  }
  EMC_TRAJ_SET_TELEOP_ENABLE joints;
  joints.enable = 0;
  const Reply free = execute(joints, "joint mode");
  if (free.code != Code::done) {
    return free;
  }
  EMC_JOINT_HOME all;
  all.joint = -1;
  const Reply homing = execute(all, "homing");
  if (homing.code != Code::done) {
    return homing;
  }
  return waitFor([&] { return status_.homed; }, HOMING_TIMEOUT) ? Reply{}
                                                                : Reply{Code::refused, "homing: timeout"};
}

/// Why no program can be accepted; empty: the machine is ready.
std::optional<Reply> ControllerLink::notReady() const {
  if (!status_.alive) {
    return Reply{Code::lost, "the controller does not run"};
  }
  if (status_.state == MachineStatus::State::emergency) {
    return Reply{Code::emergency, "emergency stop" + (status_.errors.empty() ? "" : ": " + status_.errors)};
  }
  if (status_.state != MachineStatus::State::on) {
    return Reply{Code::emergency, "the machine is off"};
  }
  if (!status_.homed) {
    return Reply{Code::refused, "the machine has not been homed"};
  }
  return std::nullopt;
}

Reply ControllerLink::open() {
  if (const std::optional<Reply> fault = notReady()) {
    return *fault;
  }
  if (status_.mode == MachineStatus::Mode::automatic && status_.busy) {
    return {Code::wrong_mode, "the controller runs a program of its own"};
  }
  // An aborted motion may still be stopping.
  if (!waitFor([&] { return !status_.busy && status_.in_position; }, STOP_TIMEOUT)) {
    return {Code::not_yet, "the machine still moves"};
  }
  return setMode(EMC_TASK_MODE_MDI);
}

Reply ControllerLink::immediate(const char* text, const char* what) {
  EMC_TASK_PLAN_EXECUTE message;
  std::snprintf(message.command, sizeof message.command, "%s", text);
  return execute(message, what);
}

Reply ControllerLink::run(const Command& command) {
  if (const std::optional<Reply> fault = notReady()) {
    return *fault;
  }
  if (status_.mode != MachineStatus::Mode::mdi) {
    return {Code::wrong_mode, "the controller is not in MDI"};
  }
  if (program_ || status_.busy) {
    return {Code::not_yet, "a program is running"};
  }
  {
    std::ofstream file(program_file_, std::ios::trunc);
    file << "o<piece> sub\n" << command.text << "\no<piece> endsub\n";
    if (!file.flush()) {
      return {Code::refused, program_file_ + ": cannot be written"};
    }
  }
  std::filesystem::permissions(program_file_, std::filesystem::perms(0644));
  EMC_TASK_PLAN_EXECUTE message;
  std::snprintf(message.command, sizeof message.command, "%s", PIECE);
  status_.running = command.number;
  status_.done = 0;
  idle_at_.reset();
  program_ = sendCommand(message);
  if (!program_) {
    return {Code::lost, "program: the controller does not answer"};
  }
  return {};
}

Reply ControllerLink::close() {
  // The spindle turns only in a machine that is ready.
  if (notReady() || status_.mode != MachineStatus::Mode::mdi || status_.busy) {
    return {};
  }
  return immediate("M5", "spindle stop");
}

Reply ControllerLink::variable(const Command& command) {
  if (const std::optional<Reply> fault = notReady()) {
    return *fault;
  }
  if (status_.mode != MachineStatus::Mode::mdi || status_.busy) {
    return {Code::wrong_mode, "variables are written while motion is armed and nothing runs"};
  }
  char text[80];
  std::snprintf(text, sizeof text, "#%d=%.9f", command.number, command.value);
  return immediate(text, "variable");
}

Reply ControllerLink::carryOut(const Command& command) {
  poll();
  if (!status_.alive) {
    return {Code::lost, "the controller does not run"};
  }
  switch (command.code) {
    case CommandCode::ready:
      return makeReady();
    case CommandCode::open:
      return open();
    case CommandCode::run:
      return run(command);
    case CommandCode::close:
      return close();
    case CommandCode::abort: {
      program_.reset();
      EMC_TASK_ABORT message;
      return execute(message, "abort");
    }
    case CommandCode::estop:
      program_.reset();
      return setState(EMC_TASK_STATE_ESTOP);
    case CommandCode::hold: {
      EMC_TASK_PLAN_PAUSE message;
      return sendCommand(message) ? Reply{} : Reply{Code::lost, "feed hold: the controller does not answer"};
    }
    case CommandCode::resume: {
      EMC_TASK_PLAN_RESUME message;
      return sendCommand(message) ? Reply{} : Reply{Code::lost, "resume: the controller does not answer"};
    }
    case CommandCode::variable:
      return variable(command);
    case CommandCode::guard:
      return {};
  }
  return {Code::refused, "unknown command"};
}

}  // namespace smartmill::cnc::linuxcnc
