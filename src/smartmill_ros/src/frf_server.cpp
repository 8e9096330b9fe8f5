#include "smartmill_ros/frf_server.h"

#include <algorithm>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

#include <actionlib/server/action_server.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <boost/function.hpp>

#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/goals.h"
#include "smartmill_ros/latched_topic.h"

namespace smartmill {
namespace {

using Server = actionlib::ActionServer<smartmill_msgs::MeasureFrfAction>;
using Handle = Server::GoalHandle;

smartmill_msgs::MeasureFrfResult resultWithoutFrf(FrfCode code, const std::string& text) {
  smartmill_msgs::MeasureFrfResult result;
  result.code = static_cast<std::uint8_t>(code);
  result.message = text;
  result.sensitivity = result.sensitivity_std = result.flute_sure = NOT_A_NUMBER;
  return result;
}

}  // namespace

struct FrfServer::Impl {
  struct Pending {
    Handle handle;
    ros::SteadyTime since;
    bool answered = false;

    void reject(FrfCode code, const std::string& reason) {
      answered = true;
      handle.setRejected(resultWithoutFrf(code, reason), reason);
    }
  };

  Impl(ros::NodeHandle nh, const std::string& action, std::string node_name, Handlers node_handlers)
      : node(std::move(node_name)),
        handlers(std::move(node_handlers)),
        frf(nh, names::TOOL_FRF),
        modes(nh, names::TOOL_MODES),
        server(nh, action, boost::function<void(Handle)>([this](Handle handle) { onGoal(handle); }),
               boost::function<void(Handle)>([this](Handle handle) { onCancel(handle); }), false) {
    server.start();
  }

  void onGoal(Handle handle) {
    const MeasureFrfGoal goal = goalFromMsg(*handle.getGoal(), toSec(ros::Time::now()));
    auto pending = std::make_shared<Pending>();
    pending->handle = handle;
    pending->since = ros::SteadyTime::now();
    waiting.push_back(pending);
    handlers.goal(goal, [this, pending](bool free) { return begin(pending, free); });
  }

  bool begin(const std::shared_ptr<Pending>& pending, bool free) {
    waiting.erase(std::remove(waiting.begin(), waiting.end(), pending), waiting.end());
    if (pending->answered) return false;
    if (pending->handle.getGoalStatus().status == actionlib_msgs::GoalStatus::RECALLING) {
      const auto recalled = resultWithoutFrf(FrfCode::cancelled, "cancelled before its start");
      pending->answered = true;
      pending->handle.setCanceled(recalled, recalled.message);
      return false;
    }
    if (!free) {
      pending->reject(FrfCode::bad_goal, "another measurement is running");
      return false;
    }
    pending->answered = true;
    pending->handle.setAccepted();
    active = pending->handle;
    return true;
  }

  void onCancel(Handle handle) {
    handlers.cancel([this, handle] { return active && *active == handle; });
  }

  std::string node;
  Handlers handlers;
  std::deque<std::shared_ptr<Pending>> waiting;
  std::optional<Handle> active;
  std::string last_message = "no measurement yet";
  LatchedTopic<smartmill_msgs::Frf> frf;
  LatchedTopic<smartmill_msgs::ModalModel> modes;
  Server server;
};

FrfServer::FrfServer(ros::NodeHandle nh, const std::string& action, const std::string& node,
                     Handlers handlers)
    : impl_(std::make_unique<Impl>(std::move(nh), action, node, std::move(handlers))) {
}

FrfServer::~FrfServer() = default;

const std::string& FrfServer::lastMessage() const {
  return impl_->last_message;
}

std::vector<MeasuredModes> FrfServer::modes() const {
  std::vector<MeasuredModes> modes;
  for (const auto& [direction, message] : impl_->modes.messages()) modes.push_back(fromMsg(message));
  return modes;
}

void FrfServer::feedback(const std::string& stage, double progress, int hits_done) {
  ROS_INFO("%s: %s", impl_->node.c_str(), stage.c_str());
  if (!impl_->active) return;
  smartmill_msgs::MeasureFrfFeedback message;
  message.stage = stage;
  message.progress = progress;
  message.hits_done = static_cast<std::uint32_t>(hits_done);
  impl_->active->publishFeedback(message);
}

void FrfServer::finish(const Result& result) {
  smartmill_msgs::MeasureFrfResult message = resultWithoutFrf(result.code, result.message);
  message.sensitivity = result.sensitivity;
  message.sensitivity_std = result.sensitivity_std;
  message.flute_sure = result.flute_sure;
  message.spindle_moves = static_cast<std::uint32_t>(result.spindle_moves);
  if (result.cross.frf.size() > 0) message.cross = toMsg(result.cross);
  impl_->last_message = result.message;
  if (result.frf.frf.size() > 0) message.frf = toMsg(result.frf);
  if (!result.modes.model.modes.empty()) message.modes = toMsg(result.modes);
  if (result.code == FrfCode::ok) {
    const std::string& direction = result.frf.direction;
    ROS_INFO("%s: %s: %s", impl_->node.c_str(), direction.c_str(), result.message.c_str());
    impl_->frf.publish(direction, message.frf);
    impl_->modes.publish(direction, message.modes);
    if (result.cross.frf.size() > 0) impl_->frf.publish(result.cross.direction, message.cross);
  } else {
    ROS_ERROR("%s: %s", impl_->node.c_str(), result.message.c_str());
  }
  std::optional<Handle> active = std::exchange(impl_->active, std::nullopt);
  if (!active) return;
  if (result.code == FrfCode::ok) {
    active->setSucceeded(message, result.message);
  } else if (result.code == FrfCode::cancelled) {
    active->setCanceled(message, result.message);
  } else {
    active->setAborted(message, result.message);
  }
}

void FrfServer::restart() {
  ROS_WARN("%s: time jumped back, results and goals are discarded", impl_->node.c_str());
  impl_->frf.forget();
  impl_->modes.forget();
  const auto discarded = resultWithoutFrf(FrfCode::cancelled, "time jumped back: the bag was restarted");
  if (impl_->active) impl_->active->setAborted(discarded, discarded.message);
  impl_->active.reset();
  for (const auto& pending : impl_->waiting) {
    if (!pending->answered) pending->reject(FrfCode::cancelled, discarded.message);
  }
  impl_->waiting.clear();
}

void FrfServer::refuseWaiting(const std::string& reason, double timeout) {
  for (const auto& pending : impl_->waiting) {
    if (pending->answered || (ros::SteadyTime::now() - pending->since).toSec() < timeout) continue;
    pending->reject(FrfCode::bad_data, reason);
  }
}

}  // namespace smartmill
