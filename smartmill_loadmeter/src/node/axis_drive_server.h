#pragma once

#include <list>

#include <actionlib/server/action_server.h>
#include <ros/ros.h>
#include <smartmill_msgs/IdentifyAxisDriveAction.h>

#include "smartmill_loadmeter/motor/axis_drive_recorder.h"

namespace smartmill::loadmeter {

/// ROS interface of AxisDriveRecorder: action loadmeter/identify_axis_drive.
class AxisDriveServer {
 public:
  /// @param timeout [s] without data after which a goal uses what was received
  AxisDriveServer(ros::NodeHandle nh, double timeout);

  void watch();  ///< answers the goals that wait for data; to be called now and then

 private:
  using Server = actionlib::ActionServer<smartmill_msgs::IdentifyAxisDriveAction>;
  struct Waiting {
    Server::GoalHandle handle;
    double stamp = 0.0;     // [s]
    ros::SteadyTime since;  // of its arrival
  };

  void goal(Server::GoalHandle handle);
  void cancel(const Server::GoalHandle& handle);
  void answer(Server::GoalHandle handle);

  double timeout_;
  AxisDriveRecorder recorder_;
  std::list<Waiting> waiting_;
  ros::Subscriber servo_, condition_;
  Server server_;
};

}  // namespace smartmill::loadmeter
