#include "smartmill_ros/bag_reader.h"

#include <rosbag/exceptions.h>
#include <rosbag/view.h>

namespace smartmill {

BagReader::BagReader(const std::string& path) : path_(path) {
  try {
    bag_.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    throw Error(path + ": the bag has no index: its recording was cut off (rosbag reindex mends it)");
  } catch (const rosbag::BagIOException&) {
    throw Error(path + ": cannot be read as a bag: missing, or cut off");
  } catch (const std::exception& e) {
    throw Error(path + ": is no bag: " + e.what());
  }
}

bool BagReader::has(const std::string& topic) const {
  rosbag::View view(bag_, rosbag::TopicQuery(names::absolute(topic)));
  return view.size() > 0;
}

double BagReader::duration() const {
  rosbag::View view(bag_);
  return view.size() == 0 ? 0.0 : (view.getEndTime() - view.getBeginTime()).toSec();
}

void BagReader::run(const std::function<void(double)>& progress) {
  std::vector<std::string> topics;
  for (const auto& handler : handlers_) topics.push_back(handler.first);
  try {
    rosbag::View view(bag_, rosbag::TopicQuery(topics));
    std::size_t done = 0;
    for (const rosbag::MessageInstance& instance : view) {
      handlers_.at(instance.getTopic())(instance);
      if (progress && ++done % 1000 == 0) progress(static_cast<double>(done) / view.size());
    }
    if (progress) progress(1.0);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& e) {
    // Of the bag, or of a message whose lengths are not its own.
    throw Error(path_ + ": the bag ends too early or is damaged: " + e.what());
  }
}

}  // namespace smartmill
