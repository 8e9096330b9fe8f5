// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#include "controller_link.h"

#include <filesystem>
#include <fstream>
#include <utility>

#include "smartmill_core/formatted.h"

namespace smartmill::cnc::linuxcnc {
namespace {

using Code = Reply::Code;
using State = MachineStatus::State;
using Mode = MachineStatus::Mode;

constexpr const char* PIECE = "o<piece> call";

}  // namespace

ControllerLink::ControllerLink(const std::string& nml_file, std::string program_file,
                               const GatewayOptions& options, std::function<void()> while_waiting)
    : program_file_(std::move(program_file)),
      options_(options),
      monitor_(nml_file, options),
      sender_(monitor_, options, std::move(while_waiting)) {
}

Reply ControllerLink::makeReady() {
  monitor_.clearErrors();
  monitor_.dropProgram();
  const Reply reset = sender_.setState(EMC_TASK_STATE_ESTOP_RESET);
  if (reset.code != Code::done) {
    return reset;
  }
  // The reply is "done" even if the emergency stop is held externally.
  if (!sender_.waitFor([&] { return status().state != State::emergency; }, options_.reply_timeout)) {
    return {Code::emergency, "the emergency stop cannot be reset: it is held externally"};
  }
  const Reply on = sender_.setState(EMC_TASK_STATE_ON);
  if (on.code != Code::done) {
    return on;
  }
  if (!sender_.waitFor([&] { return status().state == State::on; }, options_.reply_timeout)) {
    return {Code::refused, "the machine cannot be switched on"};
  }
  return status().homed ? Reply{} : home();
}

Reply ControllerLink::home() {
  const Reply manual = sender_.setMode(EMC_TASK_MODE_MANUAL);
  if (manual.code != Code::done) {
    return manual;
  }
  EMC_TRAJ_SET_TELEOP_ENABLE joints;
  joints.enable = 0;
  const Reply free = sender_.execute(joints, "joint mode");
  if (free.code != Code::done) {
    return free;
  }
  EMC_JOINT_HOME all;
  all.joint = -1;
  const Reply homing = sender_.execute(all, "homing");
  if (homing.code != Code::done) {
    return homing;
  }
  return sender_.waitFor([&] { return status().homed; }, options_.homing_timeout)
             ? Reply{}
             : Reply{Code::refused, "homing: timeout"};
}

/// Why no program can be accepted; empty: the machine is ready.
std::optional<Reply> ControllerLink::notReady() const {
  if (!status().alive) {
    return Reply{Code::lost, "the controller does not run"};
  }
  if (status().state == State::emergency) {
    return Reply{Code::emergency, "emergency stop" + (status().errors.empty() ? "" : ": " + status().errors)};
  }
  if (status().state != State::on) {
    return Reply{Code::emergency, "the machine is off"};
  }
  if (!status().homed) {
    return Reply{Code::refused, "the machine has not been homed"};
  }
  return std::nullopt;
}

Reply ControllerLink::open() {
  if (const std::optional<Reply> fault = notReady()) {
    return *fault;
  }
  if (status().mode == Mode::automatic && status().busy) {
    return {Code::wrong_mode, "the controller runs a program of its own"};
  }
  // An aborted motion may still be stopping.
  if (!sender_.waitFor([&] { return !status().busy && status().in_position; }, options_.stop_timeout)) {
    return {Code::not_yet, "the machine still moves"};
  }
  return sender_.setMode(EMC_TASK_MODE_MDI);
}

Reply ControllerLink::run(const Command& command) {
  if (const std::optional<Reply> fault = notReady()) {
    return *fault;
  }
  if (status().mode != Mode::mdi) {
    return {Code::wrong_mode, "the controller is not in MDI"};
  }
  if (monitor_.hasProgram() || status().busy) {
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
  EMC_TASK_PLAN_EXECUTE message = mdiBlock(PIECE);
  monitor_.expectProgram(command.number);
  monitor_.programAccepted(sender_.send(message));
  if (!monitor_.hasProgram()) {
    return {Code::lost, "program: the controller does not answer"};
  }
  return {};
}

Reply ControllerLink::close() {
  // The spindle turns only in a machine that is ready.
  if (notReady() || status().mode != Mode::mdi || status().busy) {
    return {};
  }
  return sender_.executeBlock("M5", "spindle stop");
}

Reply ControllerLink::variable(const Command& command) {
  if (const std::optional<Reply> fault = notReady()) {
    return *fault;
  }
  if (status().mode != Mode::mdi || status().busy) {
    return {Code::wrong_mode, "variables are written while motion is armed and nothing runs"};
  }
  return sender_.executeBlock(formatted("#%d=%.9f", command.number, command.value), "variable");
}

Reply ControllerLink::carryOut(const Command& command) {
  poll();
  if (!status().alive) {
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
      monitor_.dropProgram();
      EMC_TASK_ABORT message;
      return sender_.execute(message, "abort");
    }
    case CommandCode::estop:
      monitor_.dropProgram();
      return sender_.setState(EMC_TASK_STATE_ESTOP);
    case CommandCode::hold: {
      EMC_TASK_PLAN_PAUSE message;
      return sender_.send(message) ? Reply{} : Reply{Code::lost, "feed hold: the controller does not answer"};
    }
    case CommandCode::resume: {
      EMC_TASK_PLAN_RESUME message;
      return sender_.send(message) ? Reply{} : Reply{Code::lost, "resume: the controller does not answer"};
    }
    case CommandCode::variable:
      return variable(command);
    case CommandCode::guard:
      return {};
  }
  return {Code::refused, "unknown command"};
}

}  // namespace smartmill::cnc::linuxcnc
