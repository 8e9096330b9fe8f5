#include "node/bag_recorder.h"

#include <algorithm>
#include <filesystem>

#include "smartmill_ros/follower.h"

namespace smartmill::session {
namespace {

constexpr std::uint32_t UNLIMITED = 0;
constexpr double QUIET = 0.3,
                 CLOSE_TIMEOUT = 8.0;  // [s] without a message, and at most, before the file is closed

}  // namespace

BagRecorder::BagRecorder(const ros::NodeHandle& nh, const std::string& path,
                         const std::vector<std::string>& patterns, std::uint64_t split)
    : nh_(nh),
      path_(path),
      file_(path),
      split_(split),
      writer_(createRecording(path, RecordingCompression::lz4)) {
  nh_.setCallbackQueue(&queue_);
  for (const std::string& pattern : patterns) patterns_.emplace_back(pattern);
  ros::NodeHandle private_nh("~");
  private_nh.setCallbackQueue(&queue_);
  follow_ = private_nh.advertiseService(FOLLOW, &BagRecorder::follow, this);
}

void BagRecorder::subscribe() {
  if (!ros::Time::isValid()) return;  // before the first /clock there is no time of reception
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

void BagRecorder::record(double timeout) {
  queue_.callAvailable(ros::WallDuration(timeout));
}

void BagRecorder::finish() {
  const ros::SteadyTime begin = ros::SteadyTime::now();
  std::size_t previous = written_ + 1;
  while (previous != written_ && (ros::SteadyTime::now() - begin).toSec() < CLOSE_TIMEOUT) {
    previous = written_;
    record(QUIET);
  }
  close();
}

BagRecorder::Connection& BagRecorder::connectionOf(const std::string& topic, Event event) {
  const auto [found, is_new] = connections_.try_emplace({topic, event.getPublisherName()});
  Connection& known = found->second;
  if (!is_new) return known;
  const topic_tools::ShapeShifter& message = *event.getMessage();
  RecordedConnection& connection = known.header;
  connection.topic = topic;
  connection.type = message.getDataType();
  connection.md5sum = message.getMD5Sum();
  connection.definition = message.getMessageDefinition();
  connection.more["callerid"] = event.getPublisherName();
  const ros::M_string& header = event.getConnectionHeader();
  if (const auto latching = header.find("latching"); latching != header.end())
    connection.more["latching"] = latching->second;
  known.number = writer_->connect(connection);
  return known;
}

void BagRecorder::beginPart(std::uint64_t time) {
  writer_->close();
  const std::filesystem::path path(path_);
  file_ =
      (path.parent_path() / path.stem()).string() + "_" + std::to_string(++part_) + path.extension().string();
  writer_ = createRecording(file_, RecordingCompression::lz4);
  for (auto& [publisher, connection] : connections_) {
    connection.number = writer_->connect(connection.header);
    if (!connection.last.empty())
      writer_->write(connection.number, time, connection.last.data(), connection.last.size());
  }
}

void BagRecorder::write(const std::string& topic, Event event) {
  const ros::Time time = event.getReceiptTime();
  const topic_tools::ShapeShifter& message = *event.getMessage();
  bytes_.resize(message.size());
  ros::serialization::OStream stream(bytes_.data(), message.size());
  message.write(stream);
  if (writer_->size() >= split_) beginPart(time.toNSec());
  Connection& connection = connectionOf(topic, event);
  writer_->write(connection.number, time.toNSec(), bytes_.data(), bytes_.size());
  if (connection.header.isLatched()) connection.last = bytes_;
  ++written_;
  ++topics_[topic].messages;
}

bool BagRecorder::follow(smartmill_msgs::Follow::Request& request,
                         smartmill_msgs::Follow::Response& response) {
  if (request.phase == smartmill_msgs::Follow::Request::BEGIN) subscribe();
  for (const auto& [topic, recorded] : topics_) {
    response.topics.push_back(topic);
    response.taken.push_back(recorded.messages);
    response.publishers.push_back(recorded.subscriber.getNumPublishers());
  }
  return true;
}

}  // namespace smartmill::session
