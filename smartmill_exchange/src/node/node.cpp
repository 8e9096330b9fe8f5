#include "node/node.h"

#include <cstdio>

#include <topic_tools/shape_shifter.h>

#include "smartmill_core/error.h"
#include "smartmill_recording/message_codec.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"

namespace smartmill::exchange {
namespace {

constexpr double TICK = 0.2;  // [s]

double wallTime() {
  return ros::WallTime::now().toSec();
}

ServerOptions serverOptions(const ExchangeParameters& p) {
  ServerOptions options;
  options.agent.device = p.device;
  options.agent.uuid = p.uuid;
  options.agent.manufacturer = p.manufacturer;
  options.agent.model = p.machine;
  options.agent.buffer = static_cast<std::size_t>(p.buffer);
  options.agent.instance = static_cast<std::uint64_t>(wallTime());
  options.agent_address = p.agent_address;
  options.agent_port = p.agent ? p.agent_port : -1;
  options.adapter_address = p.adapter_address;
  options.adapter_port = p.adapter ? p.adapter_port : -1;
  options.heartbeat = p.heartbeat;
  options.queue = static_cast<std::size_t>(p.queue * 1e6);
  options.most_clients = static_cast<std::size_t>(p.most_clients);
  return options;
}

}  // namespace

/// Subscribes to one topic. The messages are read as in a recording (smartmill_recording), so that a
/// recording gives the same items.
struct ExchangeNode::Subscribe {
  ExchangeNode& node;

  template <class Message>
  void operator()(const char* topic) const {
    node.shell_.inputs().on<topic_tools::ShapeShifter>(
        topic, [n = &node](const topic_tools::ShapeShifter& shape, double received) {
          if (shape.getMD5Sum() != Message::MD5)
            throw Error(shape.getDataType() + " of another version, expected " + Message::TYPE +
                        " of this one");
          n->bytes_.resize(shape.size());
          ros::serialization::OStream out(n->bytes_.data(), shape.size());
          shape.write(out);
          Message message;
          readMessage(n->bytes_.data(), n->bytes_.size(), message);
          n->translator_.take(message, received);
        });
  }
};

ExchangeNode::ExchangeNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : parameters_(parametersFromServer(private_nh).readAll<ExchangeParameters>()),
      shell_(nh, private_nh, parameters_.device, parameters_.translator.input_timeout),
      translator_(parameters_.translator, {[this](const Observation& observation) { observe(observation); },
                                           [this](const Asset& asset) { store(asset); }}) {
  if (parameters_.agent || parameters_.adapter)
    server_ = std::make_unique<ExchangeServer>(serverOptions(parameters_), wallTime);
  if (!parameters_.mqtt.broker.empty()) mqtt_ = std::make_unique<MqttPublisher>(parameters_.mqtt);
  if (parameters_.opcua_port > 0) opcua_ = std::make_unique<OpcUaServer>(parameters_.opcua());
  Translator::forEachTopic(Subscribe{*this});
  shell_.every(TICK, [this] { translator_.tick(ros::Time::now().toSec()); });
  if (server_) shell_.diagnose("MTConnect", [this](auto& status) { diagnoseMtconnect(status); });
  if (mqtt_) shell_.diagnose("MQTT", [this](auto& status) { diagnoseMqtt(status); });
  if (opcua_) shell_.diagnose("OPC UA", [this](auto& status) { diagnoseOpcUa(status); });
  if (server_ && server_->agentPort() >= 0)
    std::printf("exchange: MTConnect agent at http://%s:%d/probe\n", parameters_.agent_address.c_str(),
                server_->agentPort());
  if (server_ && server_->adapterPort() >= 0)
    std::printf("exchange: SHDR adapter at %s:%d\n", parameters_.adapter_address.c_str(),
                server_->adapterPort());
  if (mqtt_)
    std::printf("exchange: MQTT to %s, topics %s/...\n", parameters_.mqtt.broker.c_str(),
                parameters_.mqtt.prefix.c_str());
  if (opcua_)
    std::printf("exchange: OPC UA at opc.tcp://%s:%d\n", parameters_.opcua_address.c_str(),
                parameters_.opcua_port);
  std::fflush(stdout);
}

void ExchangeNode::observe(const Observation& observation) {
  if (server_) server_->observe(observation);
  if (mqtt_) mqtt_->observe(observation);
  if (opcua_) opcua_->observe(observation);
}

void ExchangeNode::store(const Asset& asset) {
  if (server_) server_->store(asset);
  if (mqtt_) mqtt_->store(asset);
  if (opcua_) opcua_->store(asset);
}

void ExchangeNode::diagnoseMtconnect(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const ServerStatistics s = server_->statistics();
  status.summary(diagnostic_msgs::DiagnosticStatus::OK, "serving");
  status.add("clients of the agent", s.agent_clients);
  status.add("clients of the adapter", s.adapter_clients);
  status.add("sequence number", s.sequence);
  status.add("requests", s.requests);
  status.add("requests refused", s.refused);
  status.add("streams behind the buffer", s.late);
  status.add("clients of the adapter disconnected, slow", s.dropped);
}

void ExchangeNode::diagnoseMqtt(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const MqttStatistics s = mqtt_->statistics();
  if (s.connected) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "connected");
  } else {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN,
                   s.problem.empty() ? "not connected yet" : s.problem);
  }
  status.add("messages confirmed", s.published);
  status.add("topics waiting", s.waiting);
  status.add("values replaced by newer ones", s.replaced);
  status.add("connections", s.connections);
}

void ExchangeNode::diagnoseOpcUa(diagnostic_updater::DiagnosticStatusWrapper& status) {
  const OpcUaStatistics s = opcua_->statistics();
  status.summary(diagnostic_msgs::DiagnosticStatus::OK, "serving");
  status.add("sessions", s.sessions);
  status.add("sessions refused", s.refused);
  status.add("values written", s.written);
}

}  // namespace smartmill::exchange

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<exchange::ExchangeNode>(argc, argv, "exchange");
}
