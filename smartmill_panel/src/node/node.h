#pragma once

#include <array>
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

/// Shell around server and digests: topics to the page, digests of the forces out as topics, questions of the
/// page to the nodes that know.
class PanelNode {
 public:
  using Parameters = PanelParameters;
  /// @throws Error on a wrong parameter or a port that is taken.
  PanelNode(ros::NodeHandle nh, ros::NodeHandle private_nh);
  ~PanelNode();
  PanelNode(const PanelNode&) = delete;
  PanelNode& operator=(const PanelNode&) = delete;

 private:
  /// Digests of one source of force (ForceStrip.MEASURED, ...).
  struct Digests {
    std::uint8_t source = 0;
    std::unique_ptr<StripMaker> strip;
    std::unique_ptr<RevolutionMaker> revolution;
    std::unique_ptr<SpectrumMaker> spectrum;
  };
  void listen();
  void listen(const char* topic, std::size_t source);
  void publish(Digests& digests);
  void answer(Question question, const Server::Respond& respond);
  Answer answerNow(const Question& question);
  std::string config() const;
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  PanelParameters parameters_;
  ros::NodeHandle nh_;
  NodeShell shell_;
  CommandGate gate_;
  AngleTrack angle_;
  std::string condition_;
  std::uint32_t teeth_ = 0;
  bool steady_ = false;
  std::array<Digests, 3> digests_;
  ros::Publisher strip_, revolution_, spectrum_;
  PanelLog log_;
  std::unique_ptr<Commands> commands_;
  Worker worker_, discovery_;  // the latter waits for the master, should that be away
  Server server_;
  TopicBridge bridge_;
};

}  // namespace smartmill::panel
