// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>

namespace smartmill::cnc::linuxcnc {

/// Times and limits of the gateway.
struct GatewayOptions {
  int poll_period = 2;          ///< [ms] between two reads of the status: two servo cycles
  double wait_period = 1e-3;    ///< [s] the same while a command waits: each cycle of the task
  double attach_period = 0.5;   ///< [s] between two attempts to open the channels of a controller that starts
  double reply_timeout = 1.0;   ///< [s] of a command: a thousand cycles of the task
  double homing_timeout = 3.0;  ///< [s] with absolute encoders no axis moves
  double stop_timeout = 0.3;    ///< [s] in which an aborted motion brakes to rest
  double error_delay = 0.02;    ///< [s] by which the text of an error may follow its state
  std::uint32_t settled = 4;    ///< [servo cycles] idle before a program counts as ended: the states of task
                                ///< and motion are not of the same cycle
  std::size_t max_clients = 8;  ///< the bridge, the stream and the panel have one connection each
  std::size_t max_commands = 8;  ///< of a client that does not wait for its replies; more are discarded
};

}  // namespace smartmill::cnc::linuxcnc
