#pragma once

#include <map>
#include <string>

#include <ros/node_handle.h>

#include "smartmill_ros/kept_messages.h"

namespace smartmill {

/// A topic that sends a new subscriber the last message of every key (a direction). A latched topic of ROS
/// keeps one message only. The messages outlive a restart of the node (KeptMessages).
template <class Message>
class LatchedTopic {
 public:
  LatchedTopic(ros::NodeHandle& nh, const std::string& topic)
      : kept_(nh, topic),
        last_messages_(kept_.all()),
        publisher_(nh.advertise<Message>(
            topic, 10, ros::SubscriberStatusCallback([this](const ros::SingleSubscriberPublisher& to) {
              for (const auto& entry : last_messages_) to.publish(entry.second);
            }))) {}
  LatchedTopic(const LatchedTopic&) = delete;
  LatchedTopic& operator=(const LatchedTopic&) = delete;

  void publish(const std::string& key, const Message& message) {
    last_messages_[key] = message;
    kept_.keep(key, message);
    publisher_.publish(message);
  }
  void forget() {
    last_messages_.clear();
    kept_.forget();
  }
  /// Of this node, also from before its last restart.
  const std::map<std::string, Message>& messages() const { return last_messages_; }

 private:
  KeptMessages<Message> kept_;
  std::map<std::string, Message> last_messages_;
  ros::Publisher publisher_;
};

}  // namespace smartmill
