#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace smartmill::exchange {

/// The last payload of each topic, and which of them the broker has not confirmed. A payload that is replaced
/// before it was sent is not sent: the broker keeps the last one of a topic.
class RetainedState {
 public:
  using Message = std::pair<std::string, std::string>;  ///< topic, payload

  void set(const std::string& topic, const std::string& payload);
  /// The oldest unsent messages, which then count as sent. @param most [1]
  std::vector<Message> take(std::size_t most);
  /// To be sent again.
  void repeat(const std::string& topic);
  void repeatAll();

  std::size_t waiting() const { return waiting_.size(); }  ///< [1] topics
  std::uint64_t replaced() const { return replaced_; }     ///< [1] payloads that were not sent

 private:
  struct Entry {
    std::string payload;
    bool waiting = false;
  };
  std::map<std::string, Entry> topics_;
  std::deque<std::string> waiting_;
  std::uint64_t replaced_ = 0;
};

}  // namespace smartmill::exchange
