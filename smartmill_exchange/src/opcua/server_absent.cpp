// Replaces server_open62541.cpp without the library open62541.
#include "smartmill_core/error.h"
#include "smartmill_exchange/opcua/server.h"

namespace smartmill::exchange {

class OpcUaServer::Impl {};

OpcUaServer::OpcUaServer(const OpcUaOptions& options) {
  check(options);
  throw Error("opcua_port: " + std::to_string(options.port) +
              ": this build has no OPC UA; install libopen62541-1.4-dev (Debian 13), and build again");
}

OpcUaServer::~OpcUaServer() = default;

void OpcUaServer::observe(const Observation&) {
}

void OpcUaServer::store(const Asset&) {
}

OpcUaStatistics OpcUaServer::statistics() const {
  return {};
}

}  // namespace smartmill::exchange
