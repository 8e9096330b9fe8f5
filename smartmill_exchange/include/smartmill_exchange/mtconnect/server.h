#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "smartmill_exchange/items/asset.h"
#include "smartmill_exchange/items/observation.h"
#include "smartmill_exchange/mtconnect/agent.h"

namespace smartmill::exchange {

struct ServerOptions {
  AgentOptions agent;
  std::string agent_address = "127.0.0.1", adapter_address = "127.0.0.1";
  int agent_port = 0, adapter_port = 0;  ///< 0: any free one; negative: none
  double heartbeat = 10.0;               ///< [s] of the adapter, as it states in PONG
  std::size_t queue = 4u << 20;          ///< [bytes] for one client before it is disconnected
  std::size_t most_clients = 32;         ///< of agent and adapter each
};

struct ServerStatistics {
  std::size_t agent_clients = 0, adapter_clients = 0;
  std::uint64_t requests = 0, refused = 0;  ///< of the agent
  std::uint64_t dropped = 0;                ///< clients that were disconnected because they read too slowly
  std::uint64_t sequence = 0;               ///< of the last observation
  std::uint64_t late = 0;                   ///< streams that were behind the buffer
};

/// Agent and SHDR adapter on two ports, in a thread of its own. All functions are thread-safe. Clients can
/// only read.
class ExchangeServer {
 public:
  /// @param clock [s] since 1970, called in the server's thread. @throws Error when a port cannot be listened
  /// at
  ExchangeServer(const ServerOptions& options, std::function<double()> clock);
  ~ExchangeServer();

  void observe(const Observation& observation);
  void store(const Asset& asset);

  int agentPort() const;    ///< -1: none
  int adapterPort() const;  ///< -1: none
  ServerStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::exchange
