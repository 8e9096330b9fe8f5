#pragma once

#include <memory>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "node/parameters.h"
#include "smartmill_exchange/items/translator.h"
#include "smartmill_exchange/mqtt/publisher.h"
#include "smartmill_exchange/mtconnect/server.h"
#include "smartmill_exchange/opcua/server.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::exchange {

/// ROS shell of translator, server and publisher: subscribes, and has neither publishers nor services beyond
/// those of every node.
class ExchangeNode {
 public:
  using Parameters = ExchangeParameters;
  /// @throws Error on an invalid parameter or a port in use.
  ExchangeNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);

 private:
  struct Subscribe;
  void observe(const Observation& observation);
  void store(const Asset& asset);
  void diagnoseMtconnect(diagnostic_updater::DiagnosticStatusWrapper& status);
  void diagnoseMqtt(diagnostic_updater::DiagnosticStatusWrapper& status);
  void diagnoseOpcUa(diagnostic_updater::DiagnosticStatusWrapper& status);

  ExchangeParameters parameters_;
  NodeShell shell_;
  std::unique_ptr<ExchangeServer> server_;
  std::unique_ptr<MqttPublisher> mqtt_;
  std::unique_ptr<OpcUaServer> opcua_;
  Translator translator_;
  std::vector<std::uint8_t> bytes_;  // of a message
};

}  // namespace smartmill::exchange
