// Gateway between LinuxCNC's NML and smartmill_cnc's local protocol.
//
// Copyright (c) SmartMill developers.
// SPDX-License-Identifier: GPL-2.0-or-later
//
// This program is free software; you can redistribute it and/or modify it under the terms of the GNU General
// Public License as published by the Free Software Foundation; either version 2 of the License, or (at your
// option) any later version. It is distributed in the hope that it will be useful, but WITHOUT ANY WARRANTY;
// without even the implied warranty of MERCHANTABILITY or FITNESS FOR A PARTICULAR PURPOSE. See COPYING.

#include <poll.h>

#include <chrono>
#include <deque>
#include <list>
#include <memory>
#include <utility>
#include <vector>

#include "controller_link.h"
#include "smartmill_cnc/linuxcnc/liveness.h"
#include "smartmill_cnc/linuxcnc/local_socket.h"
#include "smartmill_core/program.h"
#include "smartmill_core/stop_signal.h"

namespace smartmill::cnc::linuxcnc {
namespace {

using Clock = std::chrono::steady_clock;

/// Observation of the process that permits motion (linuxcnc_stream).
struct Guard {
  ProcessWatch process;
  Liveness liveness;
  bool heard = true;
};

struct Client {
  LocalConnection connection;
  bool drives = false;           // it has opened programs and owns the running motion
  std::unique_ptr<Guard> guard;  // of linuxcnc_stream only
  std::deque<Received> waiting;  // queued commands
};

class Gateway {
 public:
  explicit Gateway(const std::string& folder)
      : link_(folder + "/mill.nml", folder + "/sub/piece.ngc", options_, [this] { receiveAll(); }),
        listener_(listenAt(folder + "/" + GATEWAY_SOCKET)) {}

  void step() {
    std::vector<pollfd> entries{{listener_.get(), POLLIN, 0}};
    for (const Client& client : clients_) {
      entries.push_back({client.connection.descriptor(), POLLIN, 0});
    }
    ::poll(entries.data(), entries.size(), options_.poll_period);
    link_.poll();
    if (std::optional<LocalConnection> connection = acceptFrom(listener_)) {
      if (clients_.size() < options_.max_clients) {
        clients_.push_back({std::move(*connection), false, nullptr, {}});
      }
    }
    receiveAll();
    for (Client& client : clients_) {
      while (!client.waiting.empty()) {
        const Received received = std::move(client.waiting.front());
        client.waiting.pop_front();
        carryOut(client, std::get<Command>(received.message), received.sequence);
      }
    }
    for (Client& client : clients_) {
      checkGuard(client);
    }
    clients_.remove_if([this](const Client& client) { return removed(client); });
  }

  /// Stops the motions of all clients, at the end of the process.
  void stopAll() {
    for (const Client& client : clients_) {
      stopFor(client);
    }
  }

 private:
  /// Answers status requests at once, also during a command; queues commands.
  void receiveAll() {
    for (Client& client : clients_) {
      client.connection.receive();
      while (std::optional<Received> received = client.connection.next()) {
        if (client.guard) {
          client.guard->heard = true;
        }
        if (std::holds_alternative<StatusRequest>(received->message)) {
          client.connection.send(link_.status(), received->sequence);
        } else if (std::holds_alternative<Command>(received->message) &&
                   client.waiting.size() < options_.max_commands) {
          client.waiting.push_back(std::move(*received));
        }
      }
      client.connection.flush();
    }
  }

  /// A guard that is silent without waiting for a processor is disconnected.
  static void checkGuard(Client& client) {
    if (!client.guard) {
      return;
    }
    Guard& guard = *client.guard;
    const double now = std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
    if (guard.liveness.update(std::exchange(guard.heard, false), guard.process, now) !=
        Liveness::Verdict::lives) {
      client.connection.close();
    }
  }

  void carryOut(Client& client, const Command& command, std::uint16_t sequence) {
    const Reply reply = link_.carryOut(command);
    if (command.code == CommandCode::open && reply.code == Reply::Code::done) {
      client.drives = true;
    }
    if (command.code == CommandCode::close) {
      client.drives = false;
    }
    if (command.code == CommandCode::guard) {
      client.guard = std::make_unique<Guard>();
      client.guard->process.watch(client.connection.peer());
    }
    client.connection.send(reply, sequence);
  }

  /// Whether the client has disconnected; stops its motion then.
  bool removed(const Client& client) {
    if (client.connection.open()) {
      return false;
    }
    stopFor(client);
    return true;
  }

  void stopFor(const Client& client) {
    if (client.guard) {
      link_.carryOut({CommandCode::estop, 0, 0.0, {}});
    } else if (client.drives) {
      link_.carryOut({CommandCode::abort, 0, 0.0, {}});
    }
  }

  const GatewayOptions options_;
  ControllerLink link_;
  LocalDescriptor listener_;
  std::list<Client> clients_;
};

}  // namespace
}  // namespace smartmill::cnc::linuxcnc

int main(int argc, char** argv) {
  using namespace smartmill::cnc::linuxcnc;
  std::string folder;
  smartmill::CommandLine line{"Gateway to the LinuxCNC of a folder with its mill.nml (docs/linuxcnc.md)."};
  line.option("folder", folder, "folder of the machine; gateway.socket is created there").required();
  return smartmill::runProgram(line, argc, argv, [&] {
    smartmill::catchStopSignals();
    Gateway gateway(folder);
    while (!smartmill::stopRequested()) {
      gateway.step();
    }
    gateway.stopAll();
  });
}
