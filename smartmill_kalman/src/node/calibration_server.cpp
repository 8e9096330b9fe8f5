#include "node/calibration_server.h"

#include <cmath>
#include <cstdint>
#include <fstream>
#include <optional>
#include <utility>

#include <actionlib/server/action_server.h>
#include <smartmill_msgs/CalibrateForceSensorAction.h>
#include <boost/function.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_kalman/sensor/tap_file.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::kalman {
namespace {

using Server = actionlib::ActionServer<smartmill_msgs::CalibrateForceSensorAction>;
using Handle = Server::GoalHandle;
using Code = CalibrationResult::Code;

constexpr double USUAL_DURATION = 0.5;  // [s]

CalibrationGoal fromMsg(const smartmill_msgs::CalibrateForceSensorGoal& message, double received) {
  CalibrationGoal goal;
  const double stamp = toSec(message.header.stamp);
  goal.stamp = stamp > 0.0 ? stamp : received;
  goal.step = static_cast<CalibrationGoal::Step>(message.step);
  goal.test = static_cast<int>(message.test);
  goal.length = message.length;
  goal.load = {message.load.x, message.load.y, message.load.z};
  if (goal.step == CalibrationGoal::Step::point)
    goal.load = {message.point.x, message.point.y, message.point.z};
  goal.reference = message.reference;
  goal.duration = message.duration == 0.0 ? USUAL_DURATION : message.duration;
  goal.file = message.file;
  return goal;
}

smartmill_msgs::CalibrateForceSensorResult answer(Code code, const std::string& text) {
  smartmill_msgs::CalibrateForceSensorResult result;
  result.code = static_cast<std::uint8_t>(code);
  result.message = text;
  return result;
}

}  // namespace

struct CalibrationServer::Impl {
  Impl(ros::NodeHandle nh, CompensationPipeline& thinking)
      : sorted(thinking),
        server(nh, names::CALIBRATE_SENSOR,
               boost::function<void(Handle)>([this](Handle handle) { onGoal(handle); }),
               boost::function<void(Handle)>([this](Handle handle) {
                 if (active && *active == handle) sorted.cancelCalibration();
               }),
               false) {
    server.start();
  }

  void onGoal(Handle handle) {
    const smartmill_msgs::CalibrateForceSensorGoal& message = *handle.getGoal();
    const auto reject = [&](const std::string& why) { handle.setRejected(answer(Code::bad_goal, why), why); };
    if (message.step > smartmill_msgs::CalibrateForceSensorGoal::POINT)
      return reject("step " + std::to_string(message.step) +
                    ": READING, FIT, VERIFY, FORGET or POINT is due");
    if (active) return reject("another step is running");
    handle.setAccepted();
    active = handle;
    file = message.file;
    sorted.push(fromMsg(message, toSec(ros::Time::now())), [this, handle](bool free) {
      // It may have been ended while it waited for its turn.
      return free && active && *active == handle;
    });
  }

  /// Calibration and readings. @throws Error.
  void write(const SpindleSensorCalibration& calibration) const {
    if (file.empty()) return;
    writeSpindleSensor(calibration, file);
    std::ofstream table(file + ".csv");
    table << sorted.calibrator().readingsTable();
    table.close();
    if (!table) throw Error(file + ".csv: cannot be written");
  }

  void end(const smartmill_msgs::CalibrateForceSensorResult& result) {
    last_message = result.message;
    if (result.code == result.OK) {
      ROS_INFO("kalman: %s", result.message.c_str());
    } else {
      ROS_ERROR("kalman: %s", result.message.c_str());
    }
    std::optional<Handle> done = std::exchange(active, std::nullopt);
    if (!done) return;
    if (result.code == result.OK) {
      done->setSucceeded(result, result.message);
    } else if (result.code == result.CANCELLED) {
      done->setCanceled(result, result.message);
    } else {
      done->setAborted(result, result.message);
    }
  }

  CompensationPipeline& sorted;
  std::string file, last_message = "no calibration yet";
  std::optional<Handle> active;
  Server server;
};

CalibrationServer::CalibrationServer(ros::NodeHandle nh, CompensationPipeline& sorted)
    : impl_(std::make_unique<Impl>(std::move(nh), sorted)) {
}

CalibrationServer::~CalibrationServer() = default;

const std::string& CalibrationServer::lastMessage() const {
  return impl_->last_message;
}

void CalibrationServer::finish(const CalibrationResult& result) {
  smartmill_msgs::CalibrateForceSensorResult message = answer(result.code, result.message);
  message.readings = static_cast<std::uint32_t>(result.readings);
  message.error.x = result.error[0];
  message.error.y = result.error[1];
  message.error.z = result.error[2];
  try {
    if (result.calibration) impl_->write(*result.calibration);
    if (result.matrix && !impl_->file.empty()) writeTapFile(impl_->sorted.plate().taps(), impl_->file);
  } catch (const Error& e) {
    message.code = message.FIT_FAILED;
    message.message = e.what();
  }
  impl_->end(message);
}

void CalibrationServer::lost(const std::string& why) {
  if (!impl_->active) return;
  const bool running = impl_->sorted.calibrator().active();
  impl_->end(answer(Code::bad_data, why));
  if (running) impl_->sorted.cancelCalibration();
}

void CalibrationServer::restart() {
  if (impl_->active) impl_->end(answer(Code::cancelled, "time went back: the bag was restarted"));
}

}  // namespace smartmill::kalman
