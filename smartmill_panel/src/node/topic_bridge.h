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

/// Forwards topics to the server with unmodified bytes. Streams are subscribed to only while a client uses
/// them; of all other topics the last messages are latched, so that a page opened later, or after the nodes
/// have ended, shows them at once.
class TopicBridge {
 public:
  TopicBridge(ros::NodeHandle nh, Server& server);

  /// Searches for new topics; to be called periodically.
  void discover();
  /// Subscribes to a stream or ends it, as Server::Handlers::wanted; called from one thread.
  void setWanted(std::uint32_t channel, bool wanted);

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
  void forward(const std::string& name, const topic_tools::ShapeShifter& message);
  static std::string keyOf(const Topic& topic, const topic_tools::ShapeShifter& message);

  ros::NodeHandle nh_;
  Server& server_;
  std::mutex mutex_;
  std::map<std::string, Topic> topics_;
};

}  // namespace smartmill::panel
