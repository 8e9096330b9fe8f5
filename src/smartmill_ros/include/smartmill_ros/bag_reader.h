#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include <rosbag/bag.h>
#include <rosbag/message_instance.h>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"

namespace smartmill {

/// Hands the messages of a recorded bag to handlers, in the order in which they were received, without a ROS
/// master.
class BagReader {
 public:
  /// @throws Error of one line naming the file: missing, truncated, not indexed, no bag.
  explicit BagReader(const std::string& path);

  /// @param topic relative to /smartmill, or absolute. The handler gets the message and the time of its
  /// reception [s].
  template <class Message>
  void on(const std::string& topic, std::function<void(const Message&, double)> handler) {
    const std::string name = names::absolute(topic);
    handlers_[name] = [this, name, handler](const rosbag::MessageInstance& instance) {
      const boost::shared_ptr<Message> message = instance.instantiate<Message>();
      if (!message) {
        throw Error(path_ + ": topic " + name + " holds " + instance.getDataType() +
                    " where another type is due");
      }
      handler(*message, instance.getTime().toSec());
    };
  }

  bool has(const std::string& topic) const;

  /// @param progress called now and then with the share done, 0..1. @throws Error when the bag ends too
  /// early.
  void run(const std::function<void(double)>& progress = {});

  double duration() const;  ///< [s] first to last message

 private:
  std::string path_;
  rosbag::Bag bag_;
  std::map<std::string, std::function<void(const rosbag::MessageInstance&)>> handlers_;
};

}  // namespace smartmill
