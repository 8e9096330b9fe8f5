#include "node/measure_server.h"

#include <algorithm>

#include <smartmill_msgs/Strike.h>
#include <boost/bind/bind.hpp>

#include "smartmill_ros/conversions.h"
#include "smartmill_ros/goals.h"

namespace smartmill::kalman {
namespace {

/// A goal that a dead stream holds back is refused after this.
constexpr double GOAL_PATIENCE = 1.0;  // [s]

smartmill_msgs::MeasureFrfResult message(FrfCode code, const std::string& text) {
  smartmill_msgs::MeasureFrfResult result;
  result.code = static_cast<std::uint8_t>(code);
  result.message = text;
  result.sensitivity = NOT_A_NUMBER;
  return result;
}

}  // namespace

MeasureServer::MeasureServer(ros::NodeHandle nh, SortedCompensation& sorted, bool strikes)
    : sorted_(sorted),
      strikes_(strikes),
      server_(nh, "kalman/measure_frf", boost::bind(&MeasureServer::onGoal, this, boost::placeholders::_1),
              boost::bind(&MeasureServer::onCancel, this, boost::placeholders::_1), false) {
  client_ = nh.serviceClient<smartmill_msgs::Strike>("daq/strike");
  // Late subscribers get every direction; a latched topic would keep the last message only.
  frf_ = nh.advertise<smartmill_msgs::Frf>(
      "tool/frf", 10, ros::SubscriberStatusCallback([this](const ros::SingleSubscriberPublisher& to) {
        for (const auto& entry : known_) to.publish(entry.second.first);
      }));
  modes_ = nh.advertise<smartmill_msgs::ModalModel>(
      "tool/modes", 10, ros::SubscriberStatusCallback([this](const ros::SingleSubscriberPublisher& to) {
        for (const auto& entry : known_) to.publish(entry.second.second);
      }));
  server_.start();
}

MeasureServer::~MeasureServer() {
  if (thread_.joinable()) thread_.join();
}

void MeasureServer::onGoal(Server::GoalHandle handle) {
  const MeasureFrfGoal goal = goalFromMsg(*handle.getGoal(), toSec(ros::Time::now()));
  auto pending = std::make_shared<Pending>();
  pending->handle = handle;
  pending->since = ros::WallTime::now();
  waiting_.push_back(pending);
  sorted_.push(goal, [this, pending](bool free) { return begin(pending, free); });
}

bool MeasureServer::begin(const std::shared_ptr<Pending>& pending, bool free) {
  waiting_.erase(std::remove(waiting_.begin(), waiting_.end(), pending), waiting_.end());
  if (pending->answered) return false;
  if (pending->handle.getGoalStatus().status == actionlib_msgs::GoalStatus::RECALLING) {
    const auto recalled = message(FrfCode::cancelled, "cancelled before it began");
    pending->handle.setCanceled(recalled, recalled.message);
    return false;
  }
  if (!free) {
    reject(*pending, FrfCode::bad_goal, "another measurement is running");
    return false;
  }
  pending->answered = true;
  pending->handle.setAccepted();
  active_ = pending->handle;
  return true;
}

void MeasureServer::reject(Pending& pending, FrfCode code, const std::string& why) {
  pending.answered = true;
  pending.handle.setRejected(message(code, why), why);
}

void MeasureServer::onCancel(Server::GoalHandle handle) {
  sorted_.event([this, handle](SensorMeasurement& m) {
    if (active_ && *active_ == handle) m.cancel();
  });
}

void MeasureServer::feedback(const TapFeedback& feedback) {
  ROS_INFO("kalman: %s", feedback.stage.c_str());
  if (!active_) return;
  smartmill_msgs::MeasureFrfFeedback out;
  out.stage = feedback.stage;
  out.progress = feedback.progress;
  out.hits_done = static_cast<std::uint32_t>(feedback.hits_done);
  active_->publishFeedback(out);
}

void MeasureServer::finish(const SensorResult& result) {
  smartmill_msgs::MeasureFrfResult out = message(result.code, result.message);
  last_message_ = result.message;
  if (result.frf.frf.size() > 0) out.frf = toMsg(result.frf);
  if (!result.modes.model.modes.empty()) out.modes = toMsg(result.modes);
  if (result.code == FrfCode::ok) {
    ROS_INFO("kalman: %s: %s", result.modes.direction.c_str(), result.message.c_str());
    known_[result.modes.direction] = {out.frf, out.modes};
    frf_.publish(out.frf);
    modes_.publish(out.modes);
  } else {
    ROS_ERROR("kalman: %s", result.message.c_str());
  }
  if (!active_) return;
  if (result.code == FrfCode::ok) {
    active_->setSucceeded(out, result.message);
  } else if (result.code == FrfCode::cancelled) {
    active_->setCanceled(out, result.message);
  } else {
    active_->setAborted(out, result.message);
  }
  active_.reset();
}

void MeasureServer::restart() {
  ROS_WARN("kalman: time went back, starting afresh");
  known_.clear();
  const smartmill_msgs::MeasureFrfResult gone =
      message(FrfCode::cancelled, "time went back: the bag was restarted");
  if (active_) active_->setAborted(gone, gone.message);
  active_.reset();
  for (const auto& pending : waiting_) {
    if (!pending->answered) reject(*pending, FrfCode::cancelled, gone.message);
  }
  waiting_.clear();
}

void MeasureServer::strike(const StrikeCommand& command) {
  if (!strikes_) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (calling_) {
      fault_ = "daq/strike: the last call has not been answered";
      return;
    }
    calling_ = true;
  }
  if (thread_.joinable()) thread_.join();
  // A service call blocks; the streams must go on meanwhile.
  thread_ = std::thread([this, direction = command.direction] {
    smartmill_msgs::Strike call;
    call.request.point = POINT_FORCE_SENSOR;
    call.request.direction = direction;
    const bool answered = client_.call(call);
    const std::lock_guard<std::mutex> lock(mutex_);
    calling_ = false;
    // Without an automatic hammer somebody hits by hand.
    if (!answered || call.response.code == smartmill_msgs::Strike::Response::NO_HAMMER) {
      by_hand_ = true;
    } else if (call.response.code != smartmill_msgs::Strike::Response::OK) {
      fault_ = "daq/strike: " + call.response.message;
    }
  });
}

void MeasureServer::poll(const std::string& dead) {
  std::string fault;
  bool by_hand = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    fault.swap(fault_);
    std::swap(by_hand, by_hand_);
  }
  if (by_hand) sorted_.event([](SensorMeasurement& m) { m.hitByHand(); });
  if (!fault.empty()) sorted_.event([fault](SensorMeasurement& m) { m.commandFailed(fault); });
  if (dead.empty()) return;
  for (const auto& pending : waiting_) {
    if (pending->answered || (ros::WallTime::now() - pending->since).toSec() < GOAL_PATIENCE) continue;
    reject(*pending, FrfCode::bad_data, dead);
  }
}

}  // namespace smartmill::kalman
