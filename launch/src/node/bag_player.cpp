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
constexpr double EVENT_RATE = 1.5;   // [Hz] topics below are events
constexpr std::uint32_t UNLIMITED = 0;
constexpr double STATE_PERIOD = 0.2;  // [s] of the published state
constexpr double POLL = 0.05;         // [s] of control requests

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
      control_service_(
          nh_.advertiseService(names::absolute(names::REPLAY_CONTROL), &BagPlayer::onControl, this)) {
  scanFile();
}

// Finds the topics, the time span and the event topics. @throws Error
void BagPlayer::scanFile() {
  const std::unique_ptr<RecordingFile> file = openRecording(path_);
  std::map<std::string, std::size_t> count;
  for (RecordingFile::Entry entry; file->next(&entry);) {
    const RecordedConnection& connection = file->connection(entry);
    if (topics_.count(connection.topic) == 0) continue;
    if (count.empty()) first_ = timeOf(entry);
    last_ = timeOf(entry);
    if (count[connection.topic]++ == 0) advertise(connection);
  }
  if (count.empty()) throw Error(path_ + ": contains none of the topics to play");
  for (const auto& [topic, messages] : count) {
    if (static_cast<double>(messages) <= EVENT_RATE * length()) event_topics_.insert(topic);
  }
}

// With type and latching as recorded.
void BagPlayer::advertise(const RecordedConnection& connection) {
  if (connection.encoding != "ros1")
    throw Error(path_ + ": topic " + connection.topic + " is encoded as " + connection.encoding +
                ", expected ros1");
  ros::AdvertiseOptions options(connection.topic, UNLIMITED, connection.md5sum, connection.type,
                                connection.definition);
  options.latch = connection.isLatched();
  publishers_[connection.topic] = nh_.advertise(options);
}

// The clock starts before the nodes are waited for, since some of them wait for the clock.
void BagPlayer::connect() {
  publishClock(first_);
  followers_.begin();
  for (const auto& [topic, publisher] : publishers_) followers_.expect(publisher);
}

void BagPlayer::publishClock(const ros::Time& time) {
  if (!clock_time_.isZero() && (time - clock_time_).toSec() < CLOCK_STEP) return;
  rosgraph_msgs::Clock message;
  message.clock = clock_time_ = time;
  clock_.publish(message);
}

bool BagPlayer::onControl(smartmill_msgs::PlayControl::Request& request,
                          smartmill_msgs::PlayControl::Response& response) {
  constexpr double MAX_SPEED = 1000.0;
  if (request.speed < 0.0 || request.speed > MAX_SPEED || request.position < 0.0) {
    response.message = "expected a speed of 0..1000 and a position >= 0 s";
    return true;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!std::isnan(request.speed)) control_.speed = request.speed;
  control_.paused = request.paused;
  if (!std::isnan(request.position)) control_.jump = std::min(request.position, length());
  response.ok = true;
  return true;
}

void BagPlayer::publishState(bool now) {
  const ros::SteadyTime time = ros::SteadyTime::now();
  if (!now && (time - state_time_).toSec() < STATE_PERIOD) return;
  state_time_ = time;
  smartmill_msgs::PlayState message;
  message.header.stamp = first_ + ros::Duration(position_);
  message.name = name_;
  message.position = position_;
  message.length = length();
  const std::lock_guard<std::mutex> lock(mutex_);
  message.speed = control_.speed;
  message.paused = control_.paused;
  state_.publish(message);
}

// Forward jumps are played at full speed. @return true: backward jump, play from the start
bool BagPlayer::takeJump() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (std::isnan(control_.jump)) return false;
  fast_until_ = control_.jump;
  control_.jump = NO_JUMP;
  return fast_until_ < position_;
}

// Waits until a message is to be published. @return false: backward jump
bool BagPlayer::waitFor(const ros::Time& time) {
  const double at = (time - first_).toSec();
  for (;;) {
    if (takeJump()) return false;
    publishState(false);
    Control control;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      control = control_;
    }
    const bool fast = at < fast_until_ || control.speed == 0.0;
    if (fast || control.paused || control.speed != paced_speed_) {
      paced_from_ = ros::SteadyTime::now();
      paced_position_ = at;
      paced_speed_ = control.speed;
    }
    if (at < fast_until_ || (fast && !control.paused)) break;
    const double remaining =
        (at - paced_position_) / control.speed - (ros::SteadyTime::now() - paced_from_).toSec();
    if (!control.paused && remaining <= 0.0) break;
    if (!ros::ok()) throw Error("interrupted by the shutdown of ROS");
    // The nodes do not take a pause for the end of the data.
    if (control.paused) followers_.settle();
    ros::WallDuration(control.paused ? POLL : std::min(remaining, POLL)).sleep();
  }
  position_ = at;
  return true;
}

// @return false: backward jump
bool BagPlayer::play(double step) {
  clock_time_ = ros::Time();
  position_ = paced_position_ = 0.0;
  paced_from_ = ros::SteadyTime::now();
  const std::unique_ptr<RecordingFile> file = openRecording(path_);
  topic_tools::ShapeShifter message;
  double next_step = step;  // [s] from the start
  for (RecordingFile::Entry entry; file->next(&entry);) {
    const RecordedConnection& connection = file->connection(entry);
    if (topics_.count(connection.topic) == 0) continue;
    if (!waitFor(timeOf(entry))) return false;
    if (step > 0.0 && position_ >= next_step) {
      followers_.step();
      next_step = position_ + step;
    }
    publishClock(timeOf(entry));
    message.morph(connection.md5sum, connection.type, connection.definition, "");
    // IStream has no constant form; the data are only read.
    ros::serialization::IStream stream(const_cast<std::uint8_t*>(file->data(entry)), entry.size);
    message.read(stream);
    followers_.publish(publishers_.at(connection.topic), message);
    if (event_topics_.count(connection.topic)) followers_.settle();
  }
  return true;
}

void BagPlayer::run(double rate, double step, bool stay) {
  control_.speed = paced_speed_ = rate;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  connect();
  for (;;) {
    while (!play(step)) continue;
    followers_.end();
    publishState(true);
    if (!stay) return;
    while (ros::ok() && !takeJump()) ros::WallDuration(POLL).sleep();
    if (!ros::ok()) return;
    followers_.begin();
  }
}

}  // namespace smartmill::session
