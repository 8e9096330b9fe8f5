#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_client.h>
#include <ros/subscriber.h>
#include <smartmill_msgs/Follow.h>

namespace smartmill {

/// Service of every node, in its private namespace (smartmill_msgs/Follow).
constexpr const char* FOLLOW = "follow";

/// What a node has said it listens to and is not connected with yet; empty: nothing. "Connected" means every
/// publisher that the master knows.
std::string unconnected(const smartmill_msgs::Follow::Response& inputs);

/// Nodes that take what somebody plays to them, and how far they are. Roscpp drops what a full queue cannot
/// hold and keeps no order across topics; who plays asks here and waits, so that nothing is lost and nothing
/// is late however busy the computer is. One thread only.
class Followers {
 public:
  /// @param nodes full names
  explicit Followers(std::vector<std::string> nodes);

  /// Waits until every node is there and connected with every publisher of its inputs.
  /// @throws Error naming what is missing when it takes longer than patience [s]
  void begin(double patience = PATIENCE);

  /// Waits until every node that listens to the topic is connected with this publisher.
  /// @throws Error as begin()
  void expect(const ros::Publisher& publisher, double patience = PATIENCE);

  /// Waits until this subscriber hears somebody: what a node says to it from now on arrives.
  /// @throws Error as begin()
  void expect(const ros::Subscriber& listener, double patience = PATIENCE);

  /// One message more was published on a topic.
  void sent(const std::string& topic) { ++sent_[topic]; }

  /// Publishes, and waits where nodes are too far behind. @throws Error as keepUp()
  template <class Message>
  void publish(const ros::Publisher& publisher, const Message& message) {
    publisher.publish(message);
    sent(publisher.getTopic());
    keepUp(AHEAD);
  }

  /// Waits while a node is more than this many messages behind. @throws Error when none moves any more
  void keepUp(std::uint64_t most);

  /// Waits until everything sent was taken, and what the nodes have said to each other of it too; so a goal
  /// or a condition is there before what comes after it. @throws Error as keepUp()
  void settle();

  /// No more will come: the nodes hand out what waits, one after the other.
  void end();

  /// More may come, from somebody else: silence counts again.
  void leave();

  static constexpr double PATIENCE = 120.0;    ///< [s] without any progress
  static constexpr std::uint64_t AHEAD = 500;  ///< messages that a node may be behind; far below any queue

 private:
  struct Node {
    std::string name;
    ros::ServiceClient client;
    std::map<std::string, std::uint64_t> begun, taken;  // by topic
  };
  using Response = smartmill_msgs::Follow::Response;
  Response ask(Node& node, std::uint8_t phase);
  bool answers(Node& node, std::uint8_t phase, Response& response);
  std::uint64_t look();
  void lookOften();
  std::uint64_t behind() const;
  void waitFor(const std::function<std::string()>& missing, double patience);

  std::vector<Node> nodes_;
  std::map<std::string, std::uint64_t> sent_;
};

}  // namespace smartmill
