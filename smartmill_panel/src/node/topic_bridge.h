#pragma once

#include <functional>
#include <map>
#include <mutex>
#include <string>

#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <topic_tools/shape_shifter.h>

#include "smartmill_panel/server/server.h"

namespace smartmill::panel {

/// Topics as they are, handed to the server: bytes untouched. Streams are subscribed to only while somebody
/// looks at them; of all else the last messages are kept, so that a page that comes later, or after the nodes
/// have gone, shows them at once.
class TopicBridge {
 public:
  TopicBridge(ros::NodeHandle nh, Server& server);

  /// Looks for new topics; from time to time.
  void discover();
  /// As Server::Handlers::wanted; from one thread.
  void want(std::uint32_t channel, bool wanted);

 private:
  struct Topic {
    std::uint32_t id = 0;
    bool advertised = false;
    std::string type;
    std::uint64_t count = 0;
    ros::Subscriber subscriber;
  };
  void add(const std::string& name, const std::string& type);
  ros::Subscriber subscribe(const std::string& name);
  void hand(const std::string& name, const topic_tools::ShapeShifter& message);
  static std::string keyOf(const Topic& topic, const topic_tools::ShapeShifter& message);

  ros::NodeHandle nh_;
  Server& server_;
  std::mutex mutex_;
  std::map<std::string, Topic> topics_;
};

}  // namespace smartmill::panel
