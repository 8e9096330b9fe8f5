#include "node/bag_player.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include <ros/spinner.h>
#include <rosgraph_msgs/Clock.h>
#include <smartmill_msgs/PlayState.h>
#include <topic_tools/shape_shifter.h>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"

namespace smartmill::session {
namespace {

constexpr double CLOCK_STEP = 0.01;  // [s] of the recording
constexpr double SELDOM = 1.5;       // [Hz] topics below are events
constexpr std::uint32_t UNLIMITED = 0;
constexpr double TELL_PERIOD = 0.2;  // [s] of the state
constexpr double NAP = 0.05;         // [s] after which a wish is heard

ros::Time timeOf(const RecordingFile::Entry& entry) {
  ros::Time time;
  return time.fromNSec(entry.time);
}

}  // namespace

BagPlayer::BagPlayer(ros::NodeHandle nh, const std::string& path, const std::vector<std::string>& topics,
                     std::vector<std::string> nodes)
    : nh_(std::move(nh)),
      path_(path),
      name_(path.substr(path.rfind('/') + 1)),
      topics_(topics.begin(), topics.end()),
      followers_(std::move(nodes)),
      clock_(nh_.advertise<rosgraph_msgs::Clock>("/clock", UNLIMITED, true)),
      state_(nh_.advertise<smartmill_msgs::PlayState>(names::absolute(names::REPLAY_STATE), 10, true)),
      control_(nh_.advertiseService(names::absolute(names::REPLAY_CONTROL), &BagPlayer::control, this)) {
  survey();
}

// Publishers, span of time and topics of events. @throws Error
void BagPlayer::survey() {
  const std::unique_ptr<RecordingFile> file = openRecording(path_);
  std::map<std::string, std::size_t> count;
  for (RecordingFile::Entry entry; file->next(&entry);) {
    const RecordedConnection& connection = file->connection(entry);
    if (topics_.count(connection.topic) == 0) continue;
    if (count.empty()) first_ = timeOf(entry);
    last_ = timeOf(entry);
    if (count[connection.topic]++ == 0) advertise(connection);
  }
  if (count.empty()) throw Error(path_ + ": holds none of the topics to be played");
  for (const auto& [topic, messages] : count) {
    if (static_cast<double>(messages) <= SELDOM * length()) seldom_.insert(topic);
  }
}

// As it was recorded: type by its description, latched or not.
void BagPlayer::advertise(const RecordedConnection& connection) {
  if (connection.encoding != "ros1")
    throw Error(path_ + ": topic " + connection.topic + " is encoded as " + connection.encoding +
                ", expected ros1");
  ros::AdvertiseOptions options(connection.topic, UNLIMITED, connection.md5sum, connection.type,
                                connection.definition);
  const auto latching = connection.more.find("latching");
  options.latch = latching != connection.more.end() && latching->second == "1";
  publishers_[connection.topic] = nh_.advertise(options);
}

// The clock begins before anybody is waited for: some wait for it themselves.
void BagPlayer::connect() {
  tick(first_);
  followers_.begin();
  for (const auto& [topic, publisher] : publishers_) followers_.expect(publisher);
}

void BagPlayer::tick(const ros::Time& time) {
  if (!told_.isZero() && (time - told_).toSec() < CLOCK_STEP) return;
  rosgraph_msgs::Clock message;
  message.clock = told_ = time;
  clock_.publish(message);
}

bool BagPlayer::control(smartmill_msgs::PlayControl::Request& request,
                        smartmill_msgs::PlayControl::Response& response) {
  constexpr double MOST = 1000.0;
  if (request.speed < 0.0 || request.speed > MOST || request.position < 0.0) {
    response.message = "speed 0..1000 and a position from 0 are due";
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!std::isnan(request.speed)) wish_.speed = request.speed;
  wish_.paused = request.paused;
  if (!std::isnan(request.position)) wish_.jump = std::min(request.position, length());
  response.ok = true;
  return true;
}

void BagPlayer::tell(bool now) {
  const ros::WallTime time = ros::WallTime::now();
  if (!now && (time - told_at_).toSec() < TELL_PERIOD) return;
  told_at_ = time;
  smartmill_msgs::PlayState message;
  message.header.stamp = first_ + ros::Duration(position_);
  message.name = name_;
  message.position = position_;
  message.length = length();
  const std::lock_guard<std::mutex> lock(mutex_);
  message.speed = wish_.speed;
  message.paused = wish_.paused;
  state_.publish(message);
}

// A jump ahead is played through at once. @return true: back, from the begin
bool BagPlayer::jumps() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (std::isnan(wish_.jump)) return false;
  fast_until_ = wish_.jump;
  wish_.jump = NO_JUMP;
  return fast_until_ < position_;
}

// Until a message is due. @return false: somebody wants to go back
bool BagPlayer::await(const ros::Time& time) {
  const double at = (time - first_).toSec();
  for (;;) {
    if (jumps()) return false;
    tell(false);
    Wish wish;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      wish = wish_;
    }
    const bool fast = at < fast_until_ || wish.speed == 0.0;
    if (fast || wish.paused || wish.speed != paced_speed_) {
      paced_from_ = ros::WallTime::now();
      paced_position_ = at;
      paced_speed_ = wish.speed;
    }
    if (at < fast_until_ || (fast && !wish.paused)) break;
    const double due = (at - paced_position_) / wish.speed - (ros::WallTime::now() - paced_from_).toSec();
    if (!wish.paused && due <= 0.0) break;
    if (!ros::ok()) throw Error("ended while playing");
    // Their own silence is no end of data for the nodes.
    if (wish.paused) followers_.settle();
    ros::WallDuration(wish.paused ? NAP : std::min(due, NAP)).sleep();
  }
  position_ = at;
  return true;
}

// @return false: somebody wants to go back
bool BagPlayer::play() {
  told_ = ros::Time();
  position_ = paced_position_ = 0.0;
  paced_from_ = ros::WallTime::now();
  const std::unique_ptr<RecordingFile> file = openRecording(path_);
  topic_tools::ShapeShifter message;
  for (RecordingFile::Entry entry; file->next(&entry);) {
    const RecordedConnection& connection = file->connection(entry);
    if (topics_.count(connection.topic) == 0) continue;
    if (!await(timeOf(entry))) return false;
    tick(timeOf(entry));
    message.morph(connection.md5sum, connection.type, connection.definition, "");
    // The stream is read only; its type has no constant form.
    ros::serialization::IStream stream(const_cast<std::uint8_t*>(file->data(entry)), entry.size);
    message.read(stream);
    followers_.publish(publishers_.at(connection.topic), message);
    if (seldom_.count(connection.topic)) followers_.settle();
  }
  return true;
}

void BagPlayer::run(double rate, bool stay) {
  wish_.speed = paced_speed_ = rate;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  connect();
  for (;;) {
    while (!play()) continue;
    followers_.end();
    tell(true);
    if (!stay) return;
    while (ros::ok() && !jumps()) ros::WallDuration(NAP).sleep();
    if (!ros::ok()) return;
    followers_.begin();
  }
}

}  // namespace smartmill::session
