#pragma once

#include <cstdint>
#include <string>

#include "smartmill_cnc/linuxcnc/local_socket.h"

namespace smartmill::cnc::linuxcnc {

/// Speaks to linuxcnc_gateway; every question is answered before the next.
class GatewayClient {
 public:
  /// @param folder of the machine @param timeout [s] > 0 of every answer @param socket that of the gateway,
  /// or of linuxcnc_stream
  GatewayClient(const std::string& folder, double timeout, const char* socket = GATEWAY_SOCKET);

  /// @throws Error of one line.
  void connect();
  bool connected() const { return connection_.open(); }
  void close() { connection_.close(); }

  /// @throws Error of one line when no answer comes in time; the connection is closed then.
  MachineStatus status();
  Reply carryOut(const Command& command);
  Reply carryOut(const SetOverrides& overrides);  ///< by linuxcnc_stream

 private:
  template <class Answer>
  Answer exchange(const Message& question);

  const std::string path_;
  const double timeout_;
  LocalConnection connection_;
  std::uint16_t sequence_ = 0;
};

}  // namespace smartmill::cnc::linuxcnc
