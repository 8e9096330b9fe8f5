#include "node/axis_drive_server.h"

#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/SampleBlock.h>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::loadmeter {
namespace {

constexpr std::uint32_t QUEUE = 1000;  // blocks, 10 s and more

smartmill_msgs::IdentifyAxisDriveResult resultOf(std::uint8_t code, const std::string& message) {
  smartmill_msgs::IdentifyAxisDriveResult result;
  result.code = code;
  result.message = message;
  return result;
}

/// Passes the messages of a topic on; one that is not valid is announced.
template <class Message>
ros::Subscriber hear(ros::NodeHandle& nh, const char* topic, AxisDriveRecorder& recorder) {
  return nh.subscribe<Message>(topic, QUEUE, [topic, &recorder](const typename Message::ConstPtr& message) {
    try {
      recorder.handle(fromMsg(*message));
    } catch (const Error& error) {
      ROS_ERROR_THROTTLE(1.0, "%s: %s", topic, error.what());
    }
  });
}

}  // namespace

AxisDriveServer::AxisDriveServer(ros::NodeHandle nh, double timeout)
    : timeout_(timeout),
      servo_(hear<smartmill_msgs::SampleBlock>(nh, names::SERVO_RECORD, recorder_)),
      condition_(hear<smartmill_msgs::CuttingCondition>(nh, names::CUTTING_CONDITION, recorder_)),
      server_(
          nh, names::IDENTIFY_AXIS_DRIVE, [this](Server::GoalHandle handle) { goal(handle); },
          [this](Server::GoalHandle handle) { cancel(handle); }, false) {
  server_.start();
}

void AxisDriveServer::goal(Server::GoalHandle handle) {
  using Result = smartmill_msgs::IdentifyAxisDriveResult;
  const auto request = handle.getGoal();
  handle.setAccepted();
  if (request->reset) {
    recorder_.reset();
    handle.setSucceeded(resultOf(Result::OK, "moves in air from now on are used"));
    return;
  }
  if (!axisIndex(request->axis)) {
    const auto result = resultOf(Result::BAD_GOAL, "axis '" + request->axis + "': expected x, y or z");
    handle.setAborted(result, result.message);
    return;
  }
  // Without a stamp the goal has the time at which the client sent it.
  const ros::Time stamp = request->header.stamp.isZero() ? handle.getGoalID().stamp : request->header.stamp;
  waiting_.push_back({handle, toSec(stamp), ros::SteadyTime::now()});
}

void AxisDriveServer::cancel(const Server::GoalHandle& handle) {
  for (auto waiting = waiting_.begin(); waiting != waiting_.end(); ++waiting) {
    if (!(waiting->handle == handle)) continue;
    waiting->handle.setCanceled(resultOf(smartmill_msgs::IdentifyAxisDriveResult::CANCELLED, "cancelled"));
    waiting_.erase(waiting);
    return;
  }
}

void AxisDriveServer::watch() {
  smartmill_msgs::IdentifyAxisDriveFeedback feedback;
  feedback.recorded = recorder_.recorded();
  for (auto waiting = waiting_.begin(); waiting != waiting_.end();) {
    const bool complete = recorder_.newest() >= waiting->stamp;
    if (complete || (ros::SteadyTime::now() - waiting->since).toSec() > timeout_) {
      answer(waiting->handle);
      waiting = waiting_.erase(waiting);
    } else {
      waiting->handle.publishFeedback(feedback);
      ++waiting;
    }
  }
}

void AxisDriveServer::answer(Server::GoalHandle handle) {
  using Result = smartmill_msgs::IdentifyAxisDriveResult;
  const std::string axis = handle.getGoal()->axis;
  Result result;
  try {
    const AxisDrive drive = recorder_.identify(*axisIndex(axis));
    result = resultOf(Result::OK, "drive of axis " + axis + ": " + drive.text());
    result.inertia = drive.inertia.value, result.inertia_std = drive.inertia.std_dev;
    result.coulomb = drive.coulomb.value, result.coulomb_std = drive.coulomb.std_dev;
    result.viscous = drive.viscous.value, result.viscous_std = drive.viscous.std_dev;
    result.offset = drive.offset.value, result.offset_std = drive.offset.std_dev;
    result.residual = drive.residual;
    ROS_INFO("%s", result.message.c_str());
  } catch (const Error& error) {
    result = resultOf(Result::BAD_DATA, error.what());
    ROS_WARN("drive of axis %s: %s", axis.c_str(), error.what());
  }
  result.recorded = recorder_.recorded();
  if (result.code == Result::OK) {
    handle.setSucceeded(result, result.message);
  } else {
    handle.setAborted(result, result.message);
  }
}

}  // namespace smartmill::loadmeter
