// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "command_sender.h"
#include "gateway_options.h"
#include "smartmill_cnc/linuxcnc/protocol.h"
#include "status_monitor.h"

namespace smartmill::cnc::linuxcnc {

/// Connection to LinuxCNC's task over NML: one command at a time, status at every poll.
class ControllerLink {
 public:
  /// @param nml_file of the controller @param program_file read by `o<piece> call`
  /// @param while_waiting called repeatedly while a command waits for the controller
  ControllerLink(const std::string& nml_file, std::string program_file, const GatewayOptions& options,
                 std::function<void()> while_waiting);
  ControllerLink(const ControllerLink&) = delete;
  ControllerLink& operator=(const ControllerLink&) = delete;

  /// See StatusMonitor.
  void poll() { monitor_.poll(); }
  const MachineStatus& status() const { return monitor_.status(); }

  /// Executes a command: waits for the controller's reply for at most `reply_timeout` (homing
  /// `homing_timeout`), polling meanwhile.
  Reply carryOut(const Command& command);

 private:
  Reply makeReady();
  Reply home();
  Reply open();
  Reply run(const Command& command);
  Reply close();
  Reply variable(const Command& command);
  std::optional<Reply> notReady() const;

  const std::string program_file_;
  const GatewayOptions options_;
  StatusMonitor monitor_;
  CommandSender sender_;
};

}  // namespace smartmill::cnc::linuxcnc
