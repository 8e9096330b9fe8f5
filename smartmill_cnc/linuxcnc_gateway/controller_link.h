// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "smartmill_cnc/linuxcnc/liveness.h"
#include "smartmill_cnc/linuxcnc/process_watch.h"
#include "smartmill_cnc/linuxcnc/protocol.h"

namespace smartmill::cnc::linuxcnc {

/// Connection to LinuxCNC's task over NML: one command at a time, status at every poll.
class ControllerLink {
 public:
  /// @param nml_file of the controller @param program_file read by `o<piece> call`
  /// @param while_waiting called repeatedly while a command waits for the controller
  ControllerLink(std::string nml_file, std::string program_file, std::function<void()> while_waiting);
  ~ControllerLink();
  ControllerLink(const ControllerLink&) = delete;
  ControllerLink& operator=(const ControllerLink&) = delete;

  /// Reads the controller's status; reattaches to a restarted controller. To be called every few
  /// milliseconds.
  void poll();
  const MachineStatus& status() const { return status_; }

  /// Executes a command: waits for the controller's reply for at most 1 s (homing 3 s), polling meanwhile.
  Reply carryOut(const Command& command);

 private:
  struct Channels;
  using Clock = std::chrono::steady_clock;

  void attach();
  void abortOrphan();
  void checkLiveness(bool beats);
  void readStatus();
  void takeErrors();
  void detectProgramEnd();
  /// Polls until the condition holds. @return false after the timeout or a lost controller
  bool waitFor(const std::function<bool()>& condition, double timeout);
  template <class NmlMessage>
  std::optional<int> sendCommand(NmlMessage& message);
  template <class NmlMessage>
  Reply execute(NmlMessage& message, const char* what);
  Reply setState(int state);
  Reply setMode(int mode);
  Reply immediate(const char* text, const char* what);
  Reply makeReady();
  Reply home();
  Reply open();
  Reply run(const Command& command);
  Reply close();
  Reply variable(const Command& command);
  Reply refusal(Reply::Code code, const std::string& what) const;
  std::optional<Reply> notReady() const;

  const std::string nml_file_, program_file_;
  const std::function<void()> while_waiting_;
  std::unique_ptr<Channels> channels_;
  MachineStatus status_;
  Clock::time_point attached_;  // last attempt to open the channels
  bool contacted_ = false;      // a running controller has been detected
  Liveness liveness_;
  ProcessWatch processes_;
  std::optional<int> program_;            // serial number of the running one
  std::optional<std::uint32_t> idle_at_;  // heartbeat since which the program is finished
};

}  // namespace smartmill::cnc::linuxcnc
