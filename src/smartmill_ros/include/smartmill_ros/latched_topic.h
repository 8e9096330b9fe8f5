#pragma once

#include <map>
#include <string>

#include <ros/node_handle.h>

namespace smartmill {

/// A topic that hands a late subscriber the last message of every key (a direction): a latched topic would
/// keep one message only.
template <class Message>
class LatchedTopic {
 public:
  LatchedTopic(ros::NodeHandle& nh, const std::string& topic)
      : publisher_(nh.advertise<Message>(
            topic, 10, ros::SubscriberStatusCallback([this](const ros::SingleSubscriberPublisher& to) {
              for (const auto& entry : kept_) to.publish(entry.second);
            }))) {}
  LatchedTopic(const LatchedTopic&) = delete;
  LatchedTopic& operator=(const LatchedTopic&) = delete;

  void publish(const std::string& key, const Message& message) {
    kept_[key] = message;
    publisher_.publish(message);
  }
  void forget() { kept_.clear(); }

 private:
  std::map<std::string, Message> kept_;
  ros::Publisher publisher_;
};

}  // namespace smartmill
