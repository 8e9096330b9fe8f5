#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "node/commands.h"
#include "node/parameters.h"
#include "node/topic_bridge.h"
#include "node/worker.h"
#include "smartmill_panel/server/command_gate.h"
#include "smartmill_panel/server/server.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::panel {

/// ROS shell of server and digests: forwards topics to the page, publishes digests of the forces, forwards
/// requests of the page to other nodes.
class PanelNode {
 public:
  using Parameters = PanelParameters;
  /// @throws Error on an invalid parameter or a port in use.
  PanelNode(ros::NodeHandle nh, ros::NodeHandle private_nh);
  ~PanelNode();
  PanelNode(const PanelNode&) = delete;
  PanelNode& operator=(const PanelNode&) = delete;

 private:
  /// Digests of one force source (ForceStrip.MEASURED, ...).
  struct Digests {
    std::uint8_t source = 0;
    std::unique_ptr<StripMaker> strip;
    std::unique_ptr<RevolutionMaker> revolution;
    std::unique_ptr<SpectrumMaker> spectrum;
  };
  void listen();
  void listen(const char* topic, std::size_t source);
  void publish(Digests& digests);
  void answer(ApiRequest request, const Server::Respond& respond);
  ApiResponse answerNow(const ApiRequest& request);
  std::string config() const;
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  PanelParameters parameters_;
  ros::NodeHandle nh_;
  NodeShell shell_;
  CommandGate gate_;
  AngleTrack angle_;
  std::string condition_;
  std::uint32_t teeth_ = 0;
  bool cut_ = false, steady_ = false;  // the condition is a steady cut; and the chatter detection judges it
  std::array<Digests, 3> digests_;
  ros::Publisher strip_, revolution_, spectrum_;
  PanelLog log_;
  std::unique_ptr<Commands> commands_;
  /// Requests below /api/ that need the token.
  std::map<std::string, std::function<ApiResponse(const ApiRequest&)>> authorised_;
  Worker worker_, discovery_;  // discovery_ blocks while the master is unreachable
  Worker instruments_;         // blocks while a device is read
  Server server_;
  TopicBridge bridge_;
};

}  // namespace smartmill::panel
