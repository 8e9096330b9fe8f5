#include "smartmill_exchange/mqtt/retained_state.h"

#include <algorithm>

namespace smartmill::exchange {

void RetainedState::set(const std::string& topic, const std::string& payload) {
  Entry& entry = topics_[topic];
  entry.payload = payload;
  if (entry.waiting) {
    ++replaced_;
  } else {
    entry.waiting = true;
    waiting_.push_back(topic);
  }
}

std::vector<RetainedState::Message> RetainedState::take(std::size_t most) {
  std::vector<Message> messages;
  while (!waiting_.empty() && messages.size() < most) {
    Entry& entry = topics_.at(waiting_.front());
    entry.waiting = false;
    messages.emplace_back(waiting_.front(), entry.payload);
    waiting_.pop_front();
  }
  return messages;
}

void RetainedState::repeat(const std::string& topic) {
  Entry& entry = topics_.at(topic);
  if (entry.waiting) return;
  entry.waiting = true;
  waiting_.push_front(topic);
}

void RetainedState::repeatAll() {
  for (auto& [topic, entry] : topics_) {
    if (entry.waiting) continue;
    entry.waiting = true;
    waiting_.push_back(topic);
  }
}

}  // namespace smartmill::exchange
