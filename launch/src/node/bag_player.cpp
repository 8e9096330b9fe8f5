#include "node/bag_player.h"

#include <utility>

#include <rosbag/query.h>
#include <rosgraph_msgs/Clock.h>

#include "smartmill_core/error.h"

namespace smartmill::session {
namespace {

constexpr double CLOCK_STEP = 0.01;  // [s] of the recording
constexpr double SELDOM = 1.5;       // [Hz] topics below are events
constexpr std::uint32_t UNLIMITED = 0;

}  // namespace

BagPlayer::BagPlayer(ros::NodeHandle nh, const std::string& path, const std::vector<std::string>& topics,
                     std::vector<std::string> nodes)
    : nh_(std::move(nh)),
      followers_(std::move(nodes)),
      clock_(nh_.advertise<rosgraph_msgs::Clock>("/clock", UNLIMITED, true)) {
  try {
    bag_.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagException& error) {
    throw Error(path + ": cannot be read as a bag: " + error.what());
  }
  view_.addQuery(bag_, rosbag::TopicQuery(topics));
  if (view_.size() == 0) throw Error(path + ": none of the topics is in it");
}

// As they were recorded: type by its description, latched or not.
void BagPlayer::advertise() {
  for (const rosbag::ConnectionInfo* connection : view_.getConnections()) {
    if (publishers_.count(connection->topic)) continue;
    ros::AdvertiseOptions options(connection->topic, UNLIMITED, connection->md5sum, connection->datatype,
                                  connection->msg_def);
    const auto latching = connection->header->find("latching");
    options.latch = latching != connection->header->end() && latching->second == "1";
    publishers_[connection->topic] = nh_.advertise(options);
  }
  std::map<std::string, std::size_t> count;
  for (const rosbag::MessageInstance& message : view_) ++count[message.getTopic()];
  const double duration = (view_.getEndTime() - view_.getBeginTime()).toSec();
  for (const auto& [topic, messages] : count) {
    if (static_cast<double>(messages) <= SELDOM * duration) seldom_.insert(topic);
  }
}

// The clock begins before anybody is waited for: some wait for it themselves.
void BagPlayer::connect() {
  advertise();
  tick(view_.getBeginTime());
  followers_.begin();
  for (const auto& [topic, publisher] : publishers_) followers_.expect(publisher);
}

void BagPlayer::tick(const ros::Time& time) {
  if (!told_.isZero() && (time - told_).toSec() < CLOCK_STEP) return;
  rosgraph_msgs::Clock message;
  message.clock = told_ = time;
  clock_.publish(message);
}

void BagPlayer::run(double rate) {
  connect();
  const ros::WallTime begin = ros::WallTime::now();
  for (const rosbag::MessageInstance& message : view_) {
    if (rate > 0.0) {
      const ros::WallDuration due((message.getTime() - view_.getBeginTime()).toSec() / rate);
      const ros::WallDuration ahead = begin + due - ros::WallTime::now();
      if (ahead > ros::WallDuration(0.0)) ahead.sleep();
    }
    tick(message.getTime());
    followers_.publish(publishers_.at(message.getTopic()), message);
    if (seldom_.count(message.getTopic())) followers_.settle();
  }
  followers_.end();
}

}  // namespace smartmill::session
