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
  /// @param split [byte] at which the recording continues in another file, NAME_1.bag, NAME_2.bag, ..., which
  /// begins with the latched messages @throws Error if the file cannot be written
  BagRecorder(const ros::NodeHandle& nh, const std::string& path, const std::vector<std::string>& patterns,
              std::uint64_t split);

  /// Subscribes to new topics that match.
  void subscribe();
  /// Writes the queued messages. @param timeout [s] of wall time to wait for a message if the queue is empty
  void record(double timeout);
  /// Writes messages still in transit, for some seconds at most, and closes the file.
  void finish();
  /// Closes the file at once; messages that wait are lost.
  void close() { writer_->close(); }
  /// The file that is being written.
  const std::string& file() const { return file_; }

 private:
  struct Connection {
    RecordedConnection header;
    std::uint32_t number = 0;        // in this file
    std::vector<std::uint8_t> last;  // message, where it is latched
  };

  bool follow(smartmill_msgs::Follow::Request& request, smartmill_msgs::Follow::Response& response);
  using Event = const ros::MessageEvent<topic_tools::ShapeShifter const>&;
  void write(const std::string& topic, Event event);
  Connection& connectionOf(const std::string& topic, Event event);
  /// @param time [ns] of the message that follows: readers sort by it
  void beginPart(std::uint64_t time);

  ros::NodeHandle nh_;
  ros::CallbackQueue queue_;
  std::vector<std::regex> patterns_;
  std::string path_, file_;
  std::uint64_t split_;  // [byte]
  unsigned part_ = 0;
  std::unique_ptr<RecordingWriter> writer_;
  std::map<std::pair<std::string, std::string>, Connection> connections_;  // by topic and publisher
  std::vector<std::uint8_t> bytes_;                                        // of one message
  struct Recorded {
    ros::Subscriber subscriber;
    std::uint64_t messages = 0;
  };
  std::map<std::string, Recorded> topics_;
  std::size_t written_ = 0;
  ros::ServiceServer follow_;
};

}  // namespace smartmill::session
