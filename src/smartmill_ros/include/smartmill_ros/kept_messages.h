#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <ros/message_traits.h>
#include <ros/node_handle.h>
#include <ros/serialization.h>

namespace smartmill {

/// Bytes as hexadecimal digits.
std::string hexOf(const std::vector<std::uint8_t>& bytes);
/// @return empty if the text does not consist of pairs of hexadecimal digits
std::vector<std::uint8_t> bytesOf(const std::string& hex);

/// Parameter that names the launch, and parameter that contains all results of this node in it.
std::string launchParameter(const ros::NodeHandle& nh);
std::string keptParameter(const ros::NodeHandle& nh);

/// Results of this node on the parameter server, which lives as long as the master: a node that is restarted
/// continues with them. Those of an earlier launch under the same master are not used: nodes.launch gives
/// each launch a name, kept/launch.
class KeptTexts {
 public:
  KeptTexts(const ros::NodeHandle& nh, const std::string& name);

  void keep(const std::string& key, const std::string& text);
  std::map<std::string, std::string> all() const;
  void forget();

 private:
  std::string parameter_;
};

/// Messages by key, in addition to KeptTexts.
template <class Message>
class KeptMessages {
 public:
  KeptMessages(const ros::NodeHandle& nh, const std::string& name) : texts_(nh, name) {}

  void keep(const std::string& key, const Message& message) {
    std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
    ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    ros::serialization::serialize(stream, message);
    texts_.keep(key, ros::message_traits::md5sum<Message>() + (":" + hexOf(bytes)));
  }
  /// Those of an other version of the message are ignored.
  std::map<std::string, Message> all() const {
    const std::string begin = ros::message_traits::md5sum<Message>() + std::string(":");
    std::map<std::string, Message> messages;
    for (const auto& [key, text] : texts_.all()) {
      if (text.compare(0, begin.size(), begin) != 0) continue;
      std::vector<std::uint8_t> bytes = bytesOf(text.substr(begin.size()));
      ros::serialization::IStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
      Message message;
      try {
        ros::serialization::deserialize(stream, message);
      } catch (const ros::serialization::StreamOverrunException&) {
        continue;
      }
      messages.emplace(key, std::move(message));
    }
    return messages;
  }
  void forget() { texts_.forget(); }

 private:
  KeptTexts texts_;
};

}  // namespace smartmill
