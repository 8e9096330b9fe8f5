// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#include "command_sender.h"

#include <chrono>
#include <cstdio>
#include <thread>
#include <utility>

namespace smartmill::cnc::linuxcnc {

using Code = Reply::Code;

EMC_TASK_PLAN_EXECUTE mdiBlock(const std::string& block) {
  EMC_TASK_PLAN_EXECUTE message;
  std::snprintf(message.command, sizeof message.command, "%s", block.c_str());
  return message;
}

CommandSender::CommandSender(StatusMonitor& monitor, const GatewayOptions& options,
                             std::function<void()> while_waiting)
    : monitor_(monitor), options_(options), while_waiting_(std::move(while_waiting)) {
}

bool CommandSender::waitFor(const std::function<bool()>& condition, double timeout) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  // poll() may find that the controller has ended and close the channels.
  while (monitor_.channels() && !condition()) {
    if (Clock::now() - begin > std::chrono::duration<double>(timeout)) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(options_.wait_period));
    monitor_.poll();
    while_waiting_();
  }
  return monitor_.channels() != nullptr;
}

std::optional<int> CommandSender::send(RCS_CMD_MSG& message) {
  if (!monitor_.channels() || monitor_.channels()->command.write(&message) != 0) {
    return std::nullopt;
  }
  const int serial = message.serial_number;
  const bool taken = waitFor([&] { return monitor_.channels()->stat().echo_serial_number - serial >= 0; },
                             options_.reply_timeout);
  return taken ? std::optional<int>(serial) : std::nullopt;
}

Reply CommandSender::execute(RCS_CMD_MSG& message, const char* what) {
  const std::optional<int> serial = send(message);
  if (!serial) {
    return {Code::lost, std::string(what) + ": the controller does not answer"};
  }
  const auto ended = [&] {
    const EMC_STAT& s = monitor_.channels()->stat();
    return s.echo_serial_number - *serial > 0 || s.status != RCS_EXEC;
  };
  if (!waitFor(ended, options_.reply_timeout)) {
    return {Code::not_yet, std::string(what) + ": not done within a second"};
  }
  if (monitor_.channels()->stat().status == RCS_ERROR) {
    waitFor([&] { return !monitor_.status().errors.empty(); }, options_.error_delay);
    const std::string& errors = monitor_.status().errors;
    return {Code::refused, std::string(what) + ": refused" + (errors.empty() ? "" : ": " + errors)};
  }
  return {};
}

Reply CommandSender::setState(EMC_TASK_STATE_ENUM state) {
  EMC_TASK_SET_STATE message;
  message.state = state;
  return execute(message, "machine state");
}

Reply CommandSender::setMode(EMC_TASK_MODE_ENUM mode) {
  if (monitor_.channels() && monitor_.channels()->stat().task.mode == mode) {
    return {};
  }
  EMC_TASK_SET_MODE message;
  message.mode = mode;
  const Reply reply = execute(message, "mode");
  if (reply.code != Code::done) {
    return reply;
  }
  const bool changed =
      waitFor([&] { return monitor_.channels()->stat().task.mode == mode; }, options_.reply_timeout);
  return changed ? Reply{} : Reply{Code::not_yet, "the controller stays in its mode"};
}

Reply CommandSender::executeBlock(const std::string& block, const char* what) {
  EMC_TASK_PLAN_EXECUTE message = mdiBlock(block);
  return execute(message, what);
}

}  // namespace smartmill::cnc::linuxcnc
