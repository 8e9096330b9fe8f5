#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>
#include <thread>

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include "node/parameters.h"
#include "smartmill_daq/acquisition/acquisition.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::daq {

/// Acquisition in ROS: blocks on the topics of the instrument's streams, its state as diagnostics.
class DaqNode {
 public:
  using Parameters = DaqNodeParameters;
  /// @throws Error on an invalid parameter or instrument file.
  DaqNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);
  ~DaqNode();

 private:
  void run();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);
  void diagnoseChannel(std::size_t channel, diagnostic_updater::DiagnosticStatusWrapper& status);

  DaqNodeParameters parameters_;
  std::map<std::string, ros::Publisher> publishers_;  // by topic
  std::unique_ptr<Acquisition> acquisition_;
  NodeShell shell_;
  std::uint64_t events_ = 0;  // at the last diagnostics
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace smartmill::daq
