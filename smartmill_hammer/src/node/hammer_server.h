#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <actionlib/client/simple_action_client.h>
#include <actionlib/server/action_server.h>
#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/Frf.h>
#include <smartmill_msgs/JogAction.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/OrientSpindleAction.h>
#include <smartmill_msgs/RunProgramAction.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_hammer/sequence/hammer_sequence.h"

namespace smartmill {
namespace hammer {

/// Node parameters beside HammerParameters.
struct NodeParameters {
  std::string model;            ///< smartmill-model/1 file
  bool command_machine = true;  ///< false: replay; commands go nowhere, the recorded streams answer them
  double hold_back = 0.05;      ///< [s] an event may arrive this long after its stamp
  double stale_timeout = 1.0;   ///< [s] of wall time without a sensor's message
};

/// Wires HammerSequence to ROS: streams and goals go through the sorter, commands to the CNC bridge's actions
/// and to daq/strike, results to tool/frf and tool/modes. All callbacks run in one thread.
class HammerServer {
 public:
  /// @throws Error on bad parameters or a bad model file.
  HammerServer(ros::NodeHandle nh, const ros::NodeHandle& private_nh);
  ~HammerServer();
  HammerServer(const HammerServer&) = delete;
  HammerServer& operator=(const HammerServer&) = delete;

 private:
  using Server = actionlib::ActionServer<smartmill_msgs::MeasureFrfAction>;
  using JogClient = actionlib::SimpleActionClient<smartmill_msgs::JogAction>;
  using OrientClient = actionlib::SimpleActionClient<smartmill_msgs::OrientSpindleAction>;
  using ProgramClient = actionlib::SimpleActionClient<smartmill_msgs::RunProgramAction>;
  struct Input {
    std::string name;
    StreamSorter::Stream stream;
    double newest;
    ros::WallTime heard;
  };
  struct PendingGoal {
    Server::GoalHandle handle;
    ros::WallTime since;
    bool answered = false;
  };

  void take(Input& input, double stamp, const StreamSorter::Deliver& deliver);
  void event(const StreamSorter::Deliver& deliver);
  void onGoal(Server::GoalHandle handle);
  void onCancel(Server::GoalHandle handle);
  void startGoal(const std::shared_ptr<PendingGoal>& pending, const MeasureFrfGoal& goal);
  void drain();
  void finish(const MeasureFrfResult& result);
  void execute(const Command& command);
  void pump();
  template <class Result, class Client, class Goal>
  void sendGoal(Client& client, const char* name, const Goal& goal);
  void motionDone(const std::string& name, bool good, const std::string& message);
  void failed(const std::string& text);
  void strike(const std::string& direction);
  void watch();
  void restart();
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);
  double newest() const;

  ros::NodeHandle nh_;
  NodeParameters node_parameters_;
  std::unique_ptr<HammerSequence> sequence_;
  std::unique_ptr<StreamSorter> sorter_;
  Input hammer_, state_, angle_;
  StreamSorter::Stream events_ = 0;

  std::unique_ptr<Server> server_;
  std::deque<std::shared_ptr<PendingGoal>> waiting_goals_;
  std::optional<Server::GoalHandle> active_goal_;
  std::unique_ptr<JogClient> jog_;
  std::unique_ptr<OrientClient> orient_;
  std::unique_ptr<ProgramClient> program_;
  std::deque<Command> commands_;
  std::string busy_with_;  // action that is running
  bool stopping_ = false;  // its failure is wanted

  ros::ServiceClient strike_client_;
  std::thread strike_thread_;
  std::mutex strike_mutex_;
  bool strike_running_ = false;
  std::string strike_fault_;

  std::map<std::string, std::pair<smartmill_msgs::Frf, smartmill_msgs::ModalModel>> known_;  // by direction
  ros::Publisher frf_publisher_, modes_publisher_;
  std::vector<ros::Subscriber> subscribers_;
  std::unique_ptr<diagnostic_updater::Updater> updater_;
  ros::WallTimer watch_timer_, diagnostics_timer_;
  std::string last_message_ = "no measurement yet";
};

}  // namespace hammer
}  // namespace smartmill
