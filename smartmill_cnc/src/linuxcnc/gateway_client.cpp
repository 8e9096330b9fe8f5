#include "smartmill_cnc/linuxcnc/gateway_client.h"

#include <chrono>

#include "smartmill_core/error.h"

namespace smartmill::cnc::linuxcnc {

GatewayClient::GatewayClient(const std::string& folder, double timeout, const char* socket)
    : path_(folder + "/" + socket), timeout_(timeout) {
}

void GatewayClient::connect() {
  connection_ = LocalConnection::to(path_);
}

template <class Answer>
Answer GatewayClient::exchange(const Message& request) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  connection_.send(request, ++sequence_);
  while (connection_.open()) {
    connection_.receive();
    while (std::optional<Received> received = connection_.next()) {
      Answer* answer = std::get_if<Answer>(&received->message);
      if (received->sequence == sequence_ && answer) {
        return std::move(*answer);
      }
    }
    connection_.flush();
    const double remaining = timeout_ - std::chrono::duration<double>(Clock::now() - begin).count();
    if (remaining <= 0.0) {
      connection_.close();
      throw Error(path_ + ": no reply within the timeout");
    }
    connection_.wait(connection_.unsent() ? std::min(remaining, 0.005) : remaining);
  }
  throw Error(path_ + ": " + (connection_.fault().empty() ? "not connected" : connection_.fault()));
}

MachineStatus GatewayClient::status() {
  return exchange<MachineStatus>(StatusRequest{});
}

Reply GatewayClient::carryOut(const Command& command) {
  return exchange<Reply>(command);
}

Reply GatewayClient::carryOut(const SetOverrides& overrides) {
  return exchange<Reply>(overrides);
}

}  // namespace smartmill::cnc::linuxcnc
