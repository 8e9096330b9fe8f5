#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "smartmill_cnc/linuxcnc/protocol.h"

namespace smartmill::cnc::linuxcnc {

constexpr const char* GATEWAY_SOCKET = "gateway.socket";  ///< in the machine's folder
constexpr const char* STREAM_SOCKET = "stream.socket";    ///< in the machine's folder

/// Owns a file descriptor.
class LocalDescriptor {
 public:
  LocalDescriptor() = default;
  explicit LocalDescriptor(int fd) : fd_(fd) {}
  LocalDescriptor(LocalDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  LocalDescriptor& operator=(LocalDescriptor&& other) noexcept;
  ~LocalDescriptor() { reset(); }
  void reset();
  int get() const { return fd_; }
  bool valid() const { return fd_ >= 0; }

 private:
  int fd_ = -1;
};

/// One end of a connection over a Unix socket that carries frames. Nothing waits but wait().
class LocalConnection {
 public:
  LocalConnection() = default;
  explicit LocalConnection(LocalDescriptor descriptor);
  /// @throws Error of one line when nobody listens there.
  static LocalConnection to(const std::string& path);

  bool open() const { return descriptor_.valid(); }
  int descriptor() const { return descriptor_.get(); }
  int peer() const;  ///< number of the process at the other end; 0: unknown
  void close();
  /// Why it is closed, when the other side or what it sent is to blame.
  const std::string& fault() const { return fault_; }

  /// Reads what has come. The connection is closed when the other side has closed it or sent what is no
  /// frame.
  void receive();
  /// A message that has come; closes the connection at what is no frame.
  std::optional<Received> next();
  /// @param seconds to wait for bytes; true when some may be there
  bool wait(double seconds) const;

  /// Sends, now or when the other side reads; closes the connection to a side that does not read.
  /// @throws Error of encode().
  void send(const Message& message, std::uint16_t sequence = 0);
  /// Sends what still waits.
  void flush();
  bool unsent() const { return !outgoing_.empty(); }

 private:
  void fail(const std::string& why);

  LocalDescriptor descriptor_;
  FrameDecoder decoder_;
  std::string outgoing_, fault_;
};

/// Listens on a path; a socket that nobody listens on any more is replaced. Only the own user may connect.
/// @throws Error of one line, also when somebody listens there.
LocalDescriptor listenAt(const std::string& path);
/// Who wants to connect now, or none.
std::optional<LocalConnection> acceptFrom(const LocalDescriptor& listener);

}  // namespace smartmill::cnc::linuxcnc
