#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include <ros/ros.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include "smartmill_ros/follower.h"

namespace smartmill::session {

/// Plays a recording with its clock to nodes that follow (smartmill_ros/follower.h), never further ahead of
/// them than their queues hold, and tells them the end. Nothing is lost and nothing comes late, however busy
/// the computer is (rosbag play goes on by the clock on the wall, whether anybody listens or not).
class BagPlayer {
 public:
  /// @param topics full names @param nodes full names of those that follow
  /// @throws Error naming the file when it cannot be read or holds none of the topics
  BagPlayer(ros::NodeHandle nh, const std::string& path, const std::vector<std::string>& topics,
            std::vector<std::string> nodes);

  /// @param rate times real time; 0: as fast as the nodes follow. @throws Error when a node is missing or
  /// takes nothing any more
  void run(double rate);

 private:
  void advertise();
  void connect();
  void tick(const ros::Time& time);

  ros::NodeHandle nh_;
  rosbag::Bag bag_;
  rosbag::View view_;
  Followers followers_;
  ros::Publisher clock_;
  ros::Time told_;  // on the clock last
  std::map<std::string, ros::Publisher> publishers_;
  std::set<std::string> seldom_;  // topics of events
};

}  // namespace smartmill::session
