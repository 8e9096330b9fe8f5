#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "smartmill_cnc/linuxcnc/protocol.h"
#include "smartmill_focas/descriptor.h"

namespace smartmill::cnc::linuxcnc {

constexpr const char* GATEWAY_SOCKET = "gateway.socket";  ///< in the machine's folder
constexpr const char* STREAM_SOCKET = "stream.socket";    ///< in the machine's folder

using LocalDescriptor = focas::Descriptor;

/// One end of a connection over a Unix socket that carries frames. Only wait() blocks.
class LocalConnection {
 public:
  LocalConnection() = default;
  explicit LocalConnection(LocalDescriptor descriptor);
  /// @throws Error (one line) when no server listens there.
  static LocalConnection to(const std::string& path);

  bool open() const { return descriptor_.valid(); }
  int descriptor() const { return descriptor_.get(); }
  int peer() const;  ///< process number of the peer; 0: unknown
  void close();
  /// Why it was closed, if the peer or an invalid frame is the cause.
  const std::string& fault() const { return fault_; }

  /// Reads the available bytes. Closes the connection if the peer has closed it or sent an invalid frame.
  void receive();
  /// The next received message; closes the connection on an invalid frame.
  std::optional<Received> next();
  /// @param seconds to wait for bytes @return whether some may be available
  bool wait(double seconds) const;

  /// Sends now or when the peer reads; closes the connection to a peer that does not read.
  /// @throws Error of encode().
  void send(const Message& message, std::uint16_t sequence = 0);
  /// Sends queued bytes.
  void flush();
  bool unsent() const { return !outgoing_.empty(); }

 private:
  void fail(const std::string& why);

  LocalDescriptor descriptor_;
  FrameDecoder decoder_;
  std::string outgoing_, fault_;
};

/// Listens on a path and replaces a stale socket. Only the same user may connect.
/// @throws Error (one line), also if another server listens there.
LocalDescriptor listenAt(const std::string& path);
/// Accepts a waiting client; empty: none waits.
std::optional<LocalConnection> acceptFrom(const LocalDescriptor& listener);

}  // namespace smartmill::cnc::linuxcnc
