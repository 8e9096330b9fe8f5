#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "smartmill_focas/codec.h"
#include "smartmill_focas/controller_interface.h"

namespace smartmill::focas {

struct ServerOptions {
  std::string bind_address = "127.0.0.1";
  std::uint16_t port = DEFAULT_PORT;  ///< 0: any free port
  int max_sessions = 5;               ///< per kind of circuit; further ones are refused with 0103
  int max_connections = 30;           ///< TCP; further ones get ECONNREFUSED, as observed on a 31i
  int receive_buffer = 4096;          ///< [byte] SO_RCVBUF: data in transit beyond the buffer of the machine
};

/// FOCAS server: independent connections to one machine. Runs its own thread.
class Server {
 public:
  /// Starts listening. @throws std::runtime_error "FOCAS server: cannot listen on HOST:PORT: REASON".
  Server(const ServerOptions& options, const ControllerInterface& controller);
  ~Server();  ///< stop()
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  std::uint16_t port() const;
  /// Closes all connections and ends the thread. May be called repeatedly.
  void stop();
  /// Number of open circuits (stream and data).
  int connections() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::focas
