#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "smartmill_focas/server.h"
#include "socket.h"

namespace smartmill::focas {

/// The listening socket of a server.
class Listener {
 public:
  /// Starts listening. @throws std::runtime_error "FOCAS server: cannot listen on HOST:PORT: REASON".
  explicit Listener(const ServerOptions& options);

  std::uint16_t port() const { return port_; }
  int descriptor() const { return socket_.get(); }  ///< -1: not listening
  void close() { socket_.reset(); }
  /// Listens, or not, so that TCP refuses connections. If the port is in use, the next call tries again.
  void listen(bool on);
  /// A connection that waits; not valid: none.
  Descriptor accept() const;

 private:
  void open();

  ServerOptions options_;
  Descriptor socket_;
  std::uint16_t port_;
};

}  // namespace smartmill::focas
