#pragma once

#include <cstdint>
#include <string>

#include "smartmill_cnc/linuxcnc/local_socket.h"

namespace smartmill::cnc::linuxcnc {

/// Client of linuxcnc_gateway; waits for each reply before the next request.
class GatewayClient {
 public:
  /// @param folder of the machine @param timeout [s] > 0 of every reply @param socket of the gateway or of
  /// linuxcnc_stream
  GatewayClient(const std::string& folder, double timeout, const char* socket = GATEWAY_SOCKET);

  /// @throws Error (one line).
  void connect();
  bool connected() const { return connection_.open(); }
  void close() { connection_.close(); }

  /// @throws Error (one line) on a timeout, which also closes the connection.
  MachineStatus status();
  Reply carryOut(const Command& command);
  Reply carryOut(const SetOverrides& overrides);  ///< for linuxcnc_stream

 private:
  template <class Answer>
  Answer exchange(const Message& request);

  const std::string path_;
  const double timeout_;
  LocalConnection connection_;
  std::uint16_t sequence_ = 0;
};

}  // namespace smartmill::cnc::linuxcnc
