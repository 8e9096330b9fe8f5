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

/// LinuxCNC's task over NML: one command at a time, status whenever it is looked at.
class ControllerLink {
 public:
  /// @param nml_file of the controller @param program_file that `o<piece> call` reads
  /// @param while_waiting is called again and again while a command waits for the controller
  ControllerLink(std::string nml_file, std::string program_file, std::function<void()> while_waiting);
  ~ControllerLink();
  ControllerLink(const ControllerLink&) = delete;
  ControllerLink& operator=(const ControllerLink&) = delete;

  /// Looks at the controller; finds it again when it was started anew. To be called every few milliseconds.
  void poll();
  const MachineStatus& status() const { return status_; }

  /// Waits for the controller's answer, a second at most (homing three), looking at it while_waiting.
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
  /// Looks until it is so. @return whether it came to it
  bool waitFor(const std::function<bool()>& so, double seconds);
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
  Clock::time_point attached_;  // when the channels were opened
  bool first_contact_ = false;            // a controller that lives has been seen
  Liveness liveness_;
  ProcessWatch processes_;
  std::optional<int> program_;            // serial number of the one that runs
  std::optional<std::uint32_t> idle_at_;  // heartbeat since when nothing of it is left
};

}  // namespace smartmill::cnc::linuxcnc
