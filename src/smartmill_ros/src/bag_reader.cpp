#include "smartmill_ros/bag_reader.h"

#include <algorithm>
#include <utility>

namespace smartmill {

BagReader::BagReader(const std::string& path) : BagReader(bagBytesOf(path), path) {
}

BagReader::BagReader(BagBytes bytes, const std::string& name)
    : path_(name), file_(std::make_unique<BagFile>(std::move(bytes), name)) {
}

bool BagReader::has(const std::string& topic) const {
  const std::string name = names::absolute(topic);
  const auto& connections = file_->connections();
  return std::any_of(connections.begin(), connections.end(),
                     [&name](const auto& connection) { return connection.second.topic == name; });
}

double BagReader::duration() const {
  if (!first_) {
    return 0.0;
  }
  // Whole seconds apart: a difference of two dates loses digits.
  return static_cast<double>(last_.seconds - first_->seconds) +
         1e-9 * (static_cast<double>(last_.nanoseconds) - static_cast<double>(first_->nanoseconds));
}

void BagReader::run(const std::function<void(double)>& progress) {
  std::size_t done = 0;
  // One look at a topic's name a connection, not a message.
  std::map<std::uint32_t, const std::function<void(const Instance&)>*> handler_of;
  try {
    while (file_->next(&last_)) {
      if (!first_) first_ = last_;
      const BagFile::Connection& connection = file_->connection(last_);
      const auto [known, is_new] = handler_of.try_emplace(last_.connection, nullptr);
      if (is_new) {
        const auto handler = handlers_.find(connection.topic);
        known->second = handler == handlers_.end() ? nullptr : &handler->second;
      }
      if (known->second != nullptr) {
        (*known->second)({connection, file_->data(last_), last_.size, last_.time()});
      }
      if (progress && ++done % 1000 == 0) {
        progress(file_->share());
      }
    }
    if (progress) {
      progress(1.0);
    }
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    // Of a message whose lengths are not its own.
    throw Error(path_ + ": the bag ends too early or is damaged: " + e.what());
  }
}

}  // namespace smartmill
