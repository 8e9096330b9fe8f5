#include "node/bag_recorder.h"

#include <algorithm>
#include <filesystem>

#include "smartmill_core/error.h"
#include "smartmill_ros/follower.h"

namespace smartmill::session {
namespace {

constexpr const char* UNFINISHED = ".active";  // as rosbag names a bag that is being written
constexpr std::uint32_t UNLIMITED = 0;
constexpr double QUIET = 0.3, PATIENCE = 8.0;  // [s] without a message, and at most, before the bag is closed

}  // namespace

BagRecorder::BagRecorder(const ros::NodeHandle& nh, const std::string& path,
                         const std::vector<std::string>& patterns)
    : nh_(nh), path_(path) {
  nh_.setCallbackQueue(&queue_);
  for (const std::string& pattern : patterns) patterns_.emplace_back(pattern);
  try {
    bag_.open(path_ + UNFINISHED, rosbag::bagmode::Write);
  } catch (const rosbag::BagException&) {
    throw Error(path_ + UNFINISHED + ": cannot be written");
  }
  bag_.setCompression(rosbag::compression::LZ4);
  ros::NodeHandle private_nh("~");
  private_nh.setCallbackQueue(&queue_);
  follow_ = private_nh.advertiseService(FOLLOW, &BagRecorder::follow, this);
}

void BagRecorder::look() {
  ros::master::V_TopicInfo topics;
  ros::master::getTopics(topics);
  for (const ros::master::TopicInfo& topic : topics) {
    const std::string& name = topic.name;
    const auto matches = [&](const std::regex& pattern) { return std::regex_match(name, pattern); };
    if (topics_.count(name) || std::none_of(patterns_.begin(), patterns_.end(), matches)) continue;
    const boost::function<void(Event)> callback = [this, name](Event event) { write(name, event); };
    topics_[name].subscriber = nh_.subscribe<topic_tools::ShapeShifter, Event>(name, UNLIMITED, callback);
  }
}

void BagRecorder::take(double patience) {
  queue_.callAvailable(ros::WallDuration(patience));
}

void BagRecorder::finish() {
  const ros::WallTime begin = ros::WallTime::now();
  std::size_t before = written_ + 1;
  while (before != written_ && (ros::WallTime::now() - begin).toSec() < PATIENCE) {
    before = written_;
    take(QUIET);
  }
  bag_.close();
  std::filesystem::rename(path_ + UNFINISHED, path_);
}

void BagRecorder::write(const std::string& topic, Event event) {
  // Simulated time may not have begun.
  bag_.write(topic, std::max(event.getReceiptTime(), ros::TIME_MIN), *event.getMessage(),
             event.getConnectionHeaderPtr());
  ++written_;
  ++topics_[topic].messages;
}

bool BagRecorder::follow(smartmill_msgs::Follow::Request&, smartmill_msgs::Follow::Response& response) {
  look();
  for (const auto& [topic, recorded] : topics_) {
    response.topics.push_back(topic);
    response.taken.push_back(recorded.messages);
    response.publishers.push_back(recorded.subscriber.getNumPublishers());
  }
  return true;
}

}  // namespace smartmill::session
