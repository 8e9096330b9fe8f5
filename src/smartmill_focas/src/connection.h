#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "smartmill_focas/codec.h"
#include "socket.h"

namespace smartmill::focas {

/// One TCP connection, opened with a code.
struct Circuit {
  Descriptor socket;
  FrameReader reader;
  Bytes unsent;

  bool valid() const { return socket.valid(); }
  void drop() {
    socket.reset();
    reader = FrameReader();
    unsent.clear();
  }
};

/// The two circuits to a controller and the transport of frames, independent of their contents. If one is
/// lost, both are dropped and functions throw ConnectionError; bytes that are no frame throw WireError.
class Connection {
 public:
  Circuit stream, data;

  /// Sets the address for open(). @param timeout [s] of every reply
  void setTarget(const std::string& host, std::uint16_t port, double timeout);
  std::string where() const;
  double timeout() const { return timeout_; }

  bool valid() const { return stream.valid() && data.valid(); }
  void drop();
  /// Sends the close request (0201) on both circuits, waits for the replies for a limited time, and drops.
  void close();
  /// @throws ConnectionError "not connected ..." if a circuit is not open.
  void requireConnected();

  /// Opens one of the two circuits. @return its open reply
  OpenReply open(Circuit& circuit);

  static void queue(Circuit& circuit, std::uint8_t type, std::uint8_t direction, const Bytes& body);
  /// @return whether all queued bytes are sent
  bool flush(Circuit& circuit);
  void flushUntil(Circuit& circuit, Clock::time_point deadline);
  /// The next received frame; empty: none.
  std::optional<Frame> poll(Circuit& circuit);
  /// As poll(); drops the connection on bytes that are no frame.
  std::optional<Frame> pollOrDrop(Circuit& circuit);
  Frame receive(Circuit& circuit, Clock::time_point deadline);

  /// Drops both circuits and throws ConnectionError.
  [[noreturn]] void fail(const std::string& reason);

 private:
  void connectSocket(Circuit& circuit, Clock::time_point deadline);

  std::string host_;
  std::uint16_t port_ = 0;
  double timeout_ = 1.0;  // [s]
};

/// "call: EW_NAME (code), detail n".
std::string failureLine(const std::string& call, int code, int detail);

}  // namespace smartmill::focas
