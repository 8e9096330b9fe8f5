#pragma once

#include <map>
#include <regex>
#include <string>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <topic_tools/shape_shifter.h>

namespace smartmill::session {

/// Records whatever is said on some topics. It loses nothing that reaches it: where the computer is too busy
/// to write, messages wait (rosbag record keeps 100 of a topic and drops the rest).
class BagRecorder {
 public:
  /// @param patterns regular expressions (ECMAScript) of whole topic names
  /// @throws Error when the file cannot be written
  BagRecorder(const ros::NodeHandle& nh, const std::string& path, const std::vector<std::string>& patterns);

  /// Subscribes to matching topics that have come up.
  void look();
  /// Takes what has come. @param patience [s] of wall time to wait when nothing is there
  void take(double patience);
  /// Takes what is still on its way, for some seconds at most, and closes the bag.
  void finish();

 private:
  using Event = const ros::MessageEvent<topic_tools::ShapeShifter const>&;
  void write(const std::string& topic, Event event);

  ros::NodeHandle nh_;
  ros::CallbackQueue queue_;
  std::string path_;
  std::vector<std::regex> patterns_;
  rosbag::Bag bag_;
  std::map<std::string, ros::Subscriber> subscribers_;
  std::size_t written_ = 0;
};

}  // namespace smartmill::session
