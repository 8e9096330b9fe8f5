#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <ros/ros.h>
#include <smartmill_msgs/BreakTooth.h>
#include <smartmill_msgs/Frf.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/Strike.h>

#include "node/clock.h"
#include "node/operator_panel.h"
#include "node/pacer.h"
#include "node/parameters.h"
#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_focas/server.h"
#include "smartmill_ros/latched_topic.h"
#include "smartmill_ros/node_shell.h"
#include "smartmill_sim/world/axes_track.h"
#include "smartmill_sim/world/world.h"

namespace smartmill::sim {

/// The simulated machine on ROS: the controller on its port, sensors on daq/* and spindle/angle (or
/// daq/tachometer), hammers by the service daq/strike, true values on sim/truth/*, the operator's panel by
/// services sim/panel/*, loss of a tooth by sim/break_tooth. Runs in wall-clock time, or as the clock of the
/// graph with /use_sim_time.
class Node {
 public:
  using Parameters = NodeParameters;
  /// @throws Error on bad parameters, a bad model file or a port in use.
  Node(ros::NodeHandle nh, const ros::NodeHandle& private_nh);
  ~Node();
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

 private:
  void run();
  void publish(const World::Block& block);
  void serve();
  void listen();
  bool updateStates(double behind);
  void logAlarms();
  void publishTruth();
  bool strike(smartmill_msgs::Strike::Request& request, smartmill_msgs::Strike::Response& response);
  bool breakTooth(smartmill_msgs::BreakTooth::Request& request,
                  smartmill_msgs::BreakTooth::Response& response);
  void addTruth(const std::string& point, const std::string& direction, const ModalModel& modes);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  ros::NodeHandle nh_;
  NodeParameters parameters_;
  MachineModel model_;
  std::unique_ptr<World> world_;
  std::unique_ptr<focas::Server> server_;

  ros::Publisher hammer_, dynamometer_, spindle_force_, angle_, tachometer_, force_, vibration_, servo_,
      motor_current_, sound_, coefficients_, load_meter_;
  LatchedTopic<smartmill_msgs::Frf> frf_;
  LatchedTopic<smartmill_msgs::ModalModel> modes_;
  ros::ServiceServer strike_server_, break_server_;
  Clock clock_;
  OperatorPanel panel_;
  NodeShell shell_;
  Pacer pacer_;
  std::atomic<double> load_{0.0};  // [1] processor time per real time
  std::atomic<std::uint64_t> lost_{0};

  // Axes and spindle under an external controller.
  std::mutex axes_mutex_;  // of the track
  AxesTrack axes_;
  std::vector<MotionState> states_;
  std::string logged_alarm_;

  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace smartmill::sim
