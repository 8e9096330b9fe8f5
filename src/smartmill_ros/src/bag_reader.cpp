#include "smartmill_ros/bag_reader.h"

#include <utility>

namespace smartmill {

BagReader::BagReader(const std::string& path) : BagReader(bagBytesOf(path), path) {
}

BagReader::BagReader(BagBytes bytes, const std::string& name)
    : path_(name), file_(std::make_unique<BagFile>(std::move(bytes), name)) {
}

bool BagReader::has(const std::string& topic) const {
  const std::string name = names::absolute(topic);
  for (const BagFile::Entry& entry : file_->entries()) {
    if (file_->connection(entry).topic == name) {
      return true;
    }
  }
  return false;
}

double BagReader::duration() const {
  const std::vector<BagFile::Entry>& entries = file_->entries();
  if (entries.empty()) {
    return 0.0;
  }
  // Whole seconds apart: a difference of two dates loses digits.
  const BagFile::Entry &first = entries.front(), &last = entries.back();
  return static_cast<double>(last.seconds - first.seconds) +
         1e-9 * (static_cast<double>(last.nanoseconds) - static_cast<double>(first.nanoseconds));
}

void BagReader::run(const std::function<void(double)>& progress) {
  const std::vector<BagFile::Entry>& entries = file_->entries();
  std::size_t done = 0;
  try {
    for (const BagFile::Entry& entry : entries) {
      const BagFile::Connection& connection = file_->connection(entry);
      const auto handler = handlers_.find(connection.topic);
      if (handler != handlers_.end()) {
        handler->second({connection, file_->data(entry), entry.size, entry.time()});
      }
      if (progress && ++done % 1000 == 0) {
        progress(static_cast<double>(done) / static_cast<double>(entries.size()));
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
