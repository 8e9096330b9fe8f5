#pragma once

#include <map>
#include <memory>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <smartmill_msgs/Follow.h>
#include <topic_tools/shape_shifter.h>

#include "smartmill_recording/recording_writer.h"

namespace smartmill::session {

/// Records topics to a bag or an MCAP file. No received message is lost: on a busy computer
/// messages are queued without limit (rosbag record keeps 100 per topic and drops the rest). Its service
/// `follow` reports to publishers which topics it is subscribed to (smartmill_ros/follower.h).
class BagRecorder {
 public:
  /// @param path ends in .bag or .mcap @param patterns regular expressions (ECMAScript) that match full topic
  /// names
  /// @throws Error if the file cannot be written
  BagRecorder(const ros::NodeHandle& nh, const std::string& path, const std::vector<std::string>& patterns);

  /// Subscribes to new topics that match.
  void subscribe();
  /// Writes the queued messages. @param timeout [s] of wall time to wait for a message if the queue is empty
  void record(double timeout);
  /// Writes messages still in transit, for some seconds at most, and closes the file.
  void finish();
  /// Closes the file at once; messages that wait are lost.
  void close() { writer_->close(); }

 private:
  bool follow(smartmill_msgs::Follow::Request& request, smartmill_msgs::Follow::Response& response);
  using Event = const ros::MessageEvent<topic_tools::ShapeShifter const>&;
  void write(const std::string& topic, Event event);
  std::uint32_t connectionOf(const std::string& topic, Event event);

  ros::NodeHandle nh_;
  ros::CallbackQueue queue_;
  std::vector<std::regex> patterns_;
  std::unique_ptr<RecordingWriter> writer_;
  std::map<std::pair<std::string, std::string>, std::uint32_t> connections_;  // by topic and publisher
  std::vector<std::uint8_t> bytes_;                                           // of one message
  struct Recorded {
    ros::Subscriber subscriber;
    std::uint64_t messages = 0;
  };
  std::map<std::string, Recorded> topics_;
  std::size_t written_ = 0;
  ros::ServiceServer follow_;
};

}  // namespace smartmill::session
