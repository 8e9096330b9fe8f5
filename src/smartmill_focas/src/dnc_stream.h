#pragma once

#include <cstddef>
#include <string>

#include "connection.h"

namespace smartmill::focas {

/// DNC sessions on the stream circuit (calls as in client.h).
class DncStream {
 public:
  explicit DncStream(Connection& connection) : connection_(connection) {}

  void start();
  std::size_t send(const char* text, std::size_t size);
  std::size_t flush();
  void end(double timeout);
  void cancel(DncResult result);
  void check();
  bool isOpen() const { return open_ && connection_.valid(); }
  bool unresponsive() const { return isOpen() && isUnresponsive(connection_.stream.socket.get()); }

 private:
  void requireSession(const std::string& call);
  void endBegin();
  bool endDone();
  void throwIfAbort(const Frame& frame, const std::string& call);

  Connection& connection_;
  bool open_ = false;
};

}  // namespace smartmill::focas
