#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "smartmill_focas/codec.h"
#include "socket.h"

namespace smartmill::focas {

using Clock = std::chrono::steady_clock;

/// [ms] for poll().
int millisecondsUntil(Clock::time_point deadline);
Clock::time_point deadlineIn(double seconds);

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

/// The two circuits to a controller and the frames on them; nothing of what the frames mean. When one is
/// lost, both are dropped. Functions throw ConnectionError then, and WireError on bytes that are no frame.
class Connection {
 public:
  Circuit stream, data;

  /// Where connectCircuit() will go. @param timeout [s] of every answer
  void setTarget(const std::string& host, std::uint16_t port, double timeout);
  std::string where() const;
  double timeout() const { return timeout_; }

  bool valid() const { return stream.valid() && data.valid(); }
  void drop();
  /// Says goodbye (0201 on both) within a bounded time, drops.
  void close();
  /// @throws ConnectionError "not connected ..." when one circuit is gone.
  void need();

  /// Opens one of the two; its open reply.
  OpenReply open(Circuit& circuit);

  static void queue(Circuit& circuit, std::uint8_t type, std::uint8_t direction, const Bytes& body);
  /// True when all went out.
  bool flush(Circuit& circuit);
  void flushUntil(Circuit& circuit, Clock::time_point deadline);
  /// A frame that is there now.
  std::optional<Frame> poll(Circuit& circuit);
  /// The same; bytes that are no frame are a loss.
  std::optional<Frame> pollOrDrop(Circuit& circuit);
  Frame receive(Circuit& circuit, Clock::time_point deadline);

  [[noreturn]] void lost(const std::string& why);

 private:
  void connectSocket(Circuit& circuit, Clock::time_point deadline);
  [[noreturn]] void cannotConnect(const std::string& why);
  int waitForConnect(int socket, Clock::time_point deadline);

  std::string host_;
  std::uint16_t port_ = 0;
  double timeout_ = 1.0;  // [s]
};

/// "call: EW_NAME (code), detail n".
std::string failureLine(const std::string& call, int code, int detail);

}  // namespace smartmill::focas
