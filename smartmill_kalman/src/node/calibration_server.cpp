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

constexpr double DEFAULT_DURATION = 0.5;  // [s] where the goal has 0

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
  goal.duration = message.duration == 0.0 ? DEFAULT_DURATION : message.duration;
  goal.file = message.file;
  return goal;
}

smartmill_msgs::CalibrateForceSensorResult resultOf(Code code, const std::string& text) {
  smartmill_msgs::CalibrateForceSensorResult result;
  result.code = static_cast<std::uint8_t>(code);
  result.message = text;
  return result;
}

}  // namespace

struct CalibrationServer::Impl {
  Impl(ros::NodeHandle nh, CompensationPipeline& target)
      : pipeline(target),
        server(nh, names::CALIBRATE_SENSOR,
               boost::function<void(Handle)>([this](Handle handle) { onGoal(handle); }),
               boost::function<void(Handle)>([this](Handle handle) {
                 if (active && *active == handle) pipeline.cancelCalibration();
               }),
               false) {
    server.start();
  }

  void onGoal(Handle handle) {
    const smartmill_msgs::CalibrateForceSensorGoal& message = *handle.getGoal();
    const auto reject = [&](const std::string& reason) {
      handle.setRejected(resultOf(Code::bad_goal, reason), reason);
    };
    if (message.step > smartmill_msgs::CalibrateForceSensorGoal::POINT)
      return reject("step " + std::to_string(message.step) +
                    ": expected READING, FIT, VERIFY, FORGET or POINT");
    if (active) return reject("another step is running");
    handle.setAccepted();
    active = handle;
    file = message.file;
    pipeline.push(fromMsg(message, toSec(ros::Time::now())), [this, handle](bool free) {
      // It may have been cancelled before its stamp was reached.
      return free && active && *active == handle;
    });
  }

  /// Writes the calibration and the measurements that it was fitted to. @throws Error.
  void write(const SpindleSensorCalibration& calibration) const {
    if (file.empty()) return;
    writeSpindleSensor(calibration, file);
    std::ofstream table(file + ".csv");
    table << pipeline.identification().calibrator().measurementTable();
    table.close();
    if (!table) throw Error(file + ".csv: cannot write");
  }

  void end(const smartmill_msgs::CalibrateForceSensorResult& result) {
    last_message = result.message;
    if (result.code == result.OK) {
      ROS_INFO("kalman: %s", result.message.c_str());
    } else {
      ROS_ERROR("kalman: %s", result.message.c_str());
    }
    std::optional<Handle> ended = std::exchange(active, std::nullopt);
    if (!ended) return;
    if (result.code == result.OK) {
      ended->setSucceeded(result, result.message);
    } else if (result.code == result.CANCELLED) {
      ended->setCanceled(result, result.message);
    } else {
      ended->setAborted(result, result.message);
    }
  }

  CompensationPipeline& pipeline;
  std::string file, last_message = "no calibration yet";
  std::optional<Handle> active;
  Server server;
};

CalibrationServer::CalibrationServer(ros::NodeHandle nh, CompensationPipeline& pipeline)
    : impl_(std::make_unique<Impl>(std::move(nh), pipeline)) {
}

CalibrationServer::~CalibrationServer() = default;

const std::string& CalibrationServer::lastMessage() const {
  return impl_->last_message;
}

void CalibrationServer::finish(const CalibrationResult& result) {
  smartmill_msgs::CalibrateForceSensorResult message = resultOf(result.code, result.message);
  message.readings = static_cast<std::uint32_t>(result.readings);
  message.error.x = result.error[0];
  message.error.y = result.error[1];
  message.error.z = result.error[2];
  try {
    const bool in_spindle = impl_->pipeline.forces().spindle().isInUse();
    if (result.calibration) {
      impl_->write(*result.calibration);
    } else if (result.memory && !impl_->file.empty()) {
      if (in_spindle) {
        writeSpindleSensor(impl_->pipeline.identification().calibrator().base(), impl_->file);
      } else {
        writeMemorySchedule(*result.memory, impl_->file);
      }
    }
    if (result.matrix && !impl_->file.empty())
      writeTapFile(impl_->pipeline.identification().plate().taps(), impl_->file);
  } catch (const Error& e) {
    message.code = message.FIT_FAILED;
    message.message = e.what();
  }
  impl_->end(message);
}

void CalibrationServer::abort(const std::string& reason) {
  if (!impl_->active) return;
  const bool running = impl_->pipeline.identification().calibrator().active();
  impl_->end(resultOf(Code::bad_data, reason));
  if (running) impl_->pipeline.cancelCalibration();
}

void CalibrationServer::restart() {
  if (impl_->active) impl_->end(resultOf(Code::cancelled, "time jumped back: the recording was restarted"));
}

}  // namespace smartmill::kalman
