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

/// Topics of a node that lack a connection to one of the publishers registered at the master, separated by ",
/// "; empty: none.
std::string unconnected(const smartmill_msgs::Follow::Response& inputs);

/// Flow control of a player of recorded data: the nodes that receive the data, and how many messages they
/// have processed. roscpp drops messages of a full queue and does not order messages across topics; the
/// player therefore waits for the nodes, so that no message is lost or late on a busy computer. Not
/// thread-safe.
class Followers {
 public:
  /// @param nodes full names
  explicit Followers(std::vector<std::string> nodes);

  /// Waits until every node runs and is connected to every publisher of its inputs.
  /// @throws Error naming what is missing after the timeout [s]
  void begin(double timeout = TIMEOUT);

  /// Waits until every node that subscribes to the topic is connected to this publisher.
  /// @throws Error as begin()
  void expect(const ros::Publisher& publisher, double timeout = TIMEOUT);

  /// Waits until this subscriber is connected to a publisher, so that it receives all later messages.
  /// @throws Error as begin()
  void expect(const ros::Subscriber& subscriber, double timeout = TIMEOUT);

  /// Counts a message that was published on a topic.
  void sent(const std::string& topic) { ++sent_[topic]; }

  /// Publishes, and waits while a node is more than AHEAD messages behind. @throws Error as keepUp()
  template <class Message>
  void publish(const ros::Publisher& publisher, const Message& message) {
    publisher.publish(message);
    sent(publisher.getTopic());
    keepUp(AHEAD);
  }

  /// Waits while a node is more than this many messages behind. @throws Error if no node makes progress
  void keepUp(std::uint64_t max_behind);

  /// Waits until all messages sent, and the messages between the nodes that result from them, are processed;
  /// a goal or a condition then precedes all later data. @throws Error as keepUp()
  void settle();

  /// As settle(), with fewer queries, then the nodes report inputs that are behind the others. @throws Error
  /// as keepUp()
  void step();

  /// Announces the end of the data: the nodes release delayed results, one node after the other.
  void end();

  /// Ends the flow control without an end of data, once all messages sent are processed: the nodes again
  /// detect missing messages. @throws Error as keepUp()
  void leave();

  static constexpr double TIMEOUT = 120.0;  ///< [s] time limit without progress
  static constexpr std::uint64_t AHEAD =
      500;  ///< messages that a node may be behind; far below any queue size

 private:
  struct Node {
    std::string name;
    ros::ServiceClient client;
    std::map<std::string, std::uint64_t> taken_at_begin, taken;  // [1] processed messages by topic
  };
  using Response = smartmill_msgs::Follow::Response;
  Response call(Node& node, std::uint8_t phase);
  bool tryCall(Node& node, std::uint8_t phase, Response& response);
  std::uint64_t updateCounts();
  void settle(int rounds);
  void waitForDelivery();
  std::uint64_t behind() const;
  void waitFor(const std::function<std::string()>& missing, double timeout);

  std::vector<Node> nodes_;
  std::map<std::string, std::uint64_t> sent_;
};

}  // namespace smartmill
