// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "gateway_options.h"
#include "nml_channels.h"
#include "smartmill_cnc/linuxcnc/liveness.h"
#include "smartmill_cnc/linuxcnc/process_watch.h"
#include "smartmill_cnc/linuxcnc/protocol.h"

namespace smartmill::cnc::linuxcnc {

/// Status of LinuxCNC's task at every poll: whether it lives, its errors, and when its program has ended.
class StatusMonitor {
 public:
  StatusMonitor(std::string nml_file, const GatewayOptions& options);

  /// Reads the controller's status; reattaches to a restarted controller. To be called every few
  /// milliseconds.
  void poll();
  const MachineStatus& status() const { return status_; }
  /// Null: no controller has opened its channels. Changed by poll().
  NmlChannels* channels() { return channels_.get(); }

  void clearErrors() { status_.errors.clear(); }
  /// A program with this number is about to be sent.
  void expectProgram(std::int32_t number);
  /// The task has accepted it. @param serial number of the command
  void programAccepted(std::optional<int> serial) { program_ = serial; }
  void dropProgram() { program_.reset(); }
  bool hasProgram() const { return program_.has_value(); }

 private:
  using Clock = std::chrono::steady_clock;

  void attach();
  void abortOrphan();
  void checkLiveness(bool beats);
  void readStatus();
  void takeErrors();
  void detectProgramEnd();

  const std::string nml_file_;
  const GatewayOptions options_;
  std::unique_ptr<NmlChannels> channels_;
  MachineStatus status_;
  Clock::time_point attached_;  // last attempt to open the channels
  bool contacted_ = false;      // a running controller has been detected
  Liveness liveness_;
  ProcessWatch processes_;
  std::optional<int> program_;            // serial number of the running one
  std::optional<std::uint32_t> idle_at_;  // heartbeat since which the program is finished
};

}  // namespace smartmill::cnc::linuxcnc
