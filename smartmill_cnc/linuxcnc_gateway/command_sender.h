// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "gateway_options.h"
#include "smartmill_cnc/linuxcnc/protocol.h"
#include "status_monitor.h"

namespace smartmill::cnc::linuxcnc {

/// Execution of one block in MDI.
EMC_TASK_PLAN_EXECUTE mdiBlock(const std::string& block);

/// Sends commands to LinuxCNC's task, one at a time, and waits for it, polling meanwhile.
class CommandSender {
 public:
  /// @param while_waiting called repeatedly while a command waits for the controller
  CommandSender(StatusMonitor& monitor, const GatewayOptions& options, std::function<void()> while_waiting);

  /// Polls until the condition holds. @return false after the timeout [s] or a lost controller
  bool waitFor(const std::function<bool()>& condition, double timeout);
  /// @return the command's serial number once the task has accepted it
  std::optional<int> send(RCS_CMD_MSG& message);
  /// Sends a command and waits for its completion. @param what the command, in the reply
  Reply execute(RCS_CMD_MSG& message, const char* what);
  Reply setState(EMC_TASK_STATE_ENUM state);
  Reply setMode(EMC_TASK_MODE_ENUM mode);
  Reply executeBlock(const std::string& block, const char* what);

 private:
  StatusMonitor& monitor_;
  const GatewayOptions options_;
  const std::function<void()> while_waiting_;
};

}  // namespace smartmill::cnc::linuxcnc
