#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <ros/message_traits.h>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/bag_file.h"

namespace smartmill {

/// Hands the messages of a recorded bag to handlers, in the order in which they were received, without a ROS
/// master.
class BagReader {
 public:
  /// @throws Error of one line naming the file: missing, truncated, not indexed, no bag.
  explicit BagReader(const std::string& path);
  /// @param name for messages
  BagReader(BagBytes bytes, const std::string& name);
  BagReader(const BagReader&) = delete;
  BagReader& operator=(const BagReader&) = delete;

  /// @param topic relative to /smartmill, or absolute. The handler gets the message and the time of its
  /// reception [s].
  template <class Message>
  void on(const std::string& topic, std::function<void(const Message&, double)> handler) {
    const std::string name = names::absolute(topic);
    // One message for all, so that its vectors' memory is taken once.
    handlers_[name] = [this, name, handler, kept = std::make_shared<Message>()](const Instance& instance) {
      static const std::string md5sum = ros::message_traits::MD5Sum<Message>::value();
      if (md5sum != "*" && md5sum != instance.connection.md5sum) {
        throw Error(path_ + ": topic " + name + " holds " + instance.connection.type +
                    " where another type is due");
      }
      Message& message = *kept;
      CheckedStream stream(instance.data, instance.size);
      ros::serialization::deserialize(stream, message);
      handler(message, instance.time);
    };
  }

  bool has(const std::string& topic) const;

  /// Once: behind it everything has been read.
  /// @param progress called now and then with the share done, 0..1. @throws Error when the bag ends too
  /// early.
  void run(const std::function<void(double)>& progress = {});

  double duration() const;  ///< [s] first to last message that run() has read

 private:
  struct Instance {
    const BagFile::Connection& connection;
    const std::uint8_t* data;
    std::uint32_t size;
    double time;  // [s]
  };

  std::string path_;
  std::unique_ptr<BagFile> file_;
  std::optional<BagFile::Entry> first_;
  BagFile::Entry last_;
  std::map<std::string, std::function<void(const Instance&)>> handlers_;
};

}  // namespace smartmill
