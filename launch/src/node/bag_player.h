#pragma once

#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <ros/ros.h>
#include <smartmill_msgs/PlayControl.h>

#include "smartmill_recording/recording_file.h"
#include "smartmill_ros/follower.h"

namespace smartmill::session {

/// Plays a bag or an MCAP file with its clock to nodes (smartmill_ros/follower.h), never further ahead of
/// them than their queues hold, and announces the end. No message is lost or late, however busy the computer
/// is (rosbag play follows the wall clock, whether a node receives or not). A client may pause it, change its
/// speed and jump (service replay/control, topic replay/state). For a jump the nodes get all data before the
/// new position, so that their state is that of an uninterrupted replay.
class BagPlayer {
 public:
  /// @param topics full names @param nodes full names of the receiving nodes
  /// @throws Error naming the file if it cannot be read or contains none of the topics
  BagPlayer(ros::NodeHandle nh, const std::string& path, const std::vector<std::string>& topics,
            std::vector<std::string> nodes);

  /// @param rate multiple of real time; 0: as fast as the nodes process the data. @param step [s] of the
  /// recording after which the nodes have processed all data and look for missing ones; 0: never. @param stay
  /// wait at the end for a jump back. @throws Error if a node is missing or stops processing messages
  void run(double rate, double step, bool stay);

 private:
  static constexpr double NO_JUMP = std::numeric_limits<double>::quiet_NaN();
  struct Control {
    double speed = 1.0;
    bool paused = false;
    double jump = NO_JUMP;  // [s] from the start
  };
  void scanFile();
  void advertise(const RecordedConnection& connection);
  void connect();
  void publishClock(const ros::Time& time);
  bool play(double step);
  bool waitFor(const ros::Time& time);
  bool takeJump();
  void publishState(bool now);
  bool onControl(smartmill_msgs::PlayControl::Request& request,
                 smartmill_msgs::PlayControl::Response& response);
  double length() const { return (last_ - first_).toSec(); }

  ros::NodeHandle nh_;
  std::string path_, name_;
  std::set<std::string> topics_;
  ros::Time first_, last_;  // of the messages played
  Followers followers_;
  ros::Publisher clock_, state_;
  ros::ServiceServer control_service_;
  std::mutex mutex_;  // guards control_
  Control control_;
  double position_ = 0.0, fast_until_ = 0.0;  // [s] from the start
  ros::SteadyTime paced_from_;                // start of the present speed
  ros::SteadyTime state_time_;                // last publication of the state
  double paced_position_ = 0.0, paced_speed_ = 0.0;
  ros::Time clock_time_;  // last published
  std::map<std::string, ros::Publisher> publishers_;
  std::set<std::string> event_topics_;
};

}  // namespace smartmill::session
