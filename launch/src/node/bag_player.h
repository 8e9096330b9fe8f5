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

/// Plays a bag or an MCAP file with its clock to nodes that follow (smartmill_ros/follower.h), never further
/// ahead of them than their queues hold, and tells them the end. Nothing is lost and nothing comes late,
/// however busy the computer is (rosbag play goes on by the clock on the wall, whether anybody listens or
/// not). Who looks on may pause it, change its speed and jump (service replay/control, topic replay/state):
/// to where he jumps, the nodes are taken through all that lies before, so that they know what they would
/// have known.
class BagPlayer {
 public:
  /// @param topics full names @param nodes full names of those that follow
  /// @throws Error naming the file when it cannot be read or holds none of the topics
  BagPlayer(ros::NodeHandle nh, const std::string& path, const std::vector<std::string>& topics,
            std::vector<std::string> nodes);

  /// @param rate times real time; 0: as fast as the nodes follow. @param stay at its end, for who wants to
  /// jump back. @throws Error when a node is missing or takes nothing any more
  void run(double rate, bool stay);

 private:
  static constexpr double NO_JUMP = std::numeric_limits<double>::quiet_NaN();
  struct Wish {
    double speed = 1.0;
    bool paused = false;
    double jump = NO_JUMP;  // [s] since the begin
  };
  void survey();
  void advertise(const RecordedConnection& connection);
  void connect();
  void tick(const ros::Time& time);
  bool play();
  bool await(const ros::Time& time);
  bool jumps();
  void tell(bool now);
  bool control(smartmill_msgs::PlayControl::Request& request,
               smartmill_msgs::PlayControl::Response& response);
  double length() const { return (last_ - first_).toSec(); }

  ros::NodeHandle nh_;
  std::string path_, name_;
  std::set<std::string> topics_;
  ros::Time first_, last_;  // of the messages played
  Followers followers_;
  ros::Publisher clock_, state_;
  ros::ServiceServer control_;
  std::mutex mutex_;  // of the wish
  Wish wish_;
  double position_ = 0.0, fast_until_ = 0.0;  // [s] since the begin
  ros::WallTime paced_from_, told_at_;        // where the speed holds since
  double paced_position_ = 0.0, paced_speed_ = 0.0;
  ros::Time told_;  // on the clock last
  std::map<std::string, ros::Publisher> publishers_;
  std::set<std::string> seldom_;  // topics of events
};

}  // namespace smartmill::session
