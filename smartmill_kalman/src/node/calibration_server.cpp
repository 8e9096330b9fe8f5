#include "node/calibration_server.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <optional>
#include <utility>
#include <vector>

#include <actionlib/server/action_server.h>
#include <smartmill_msgs/CalibrateForceSensorAction.h>
#include <boost/function.hpp>

#include "node/calibration_goal.h"
#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_kalman/sensor/tap_file.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::kalman {
namespace {

using Server = actionlib::ActionServer<smartmill_msgs::CalibrateForceSensorAction>;
using Handle = Server::GoalHandle;
using Code = CalibrationResult::Code;

smartmill_msgs::CalibrateForceSensorResult resultOf(Code code, const std::string& text) {
  smartmill_msgs::CalibrateForceSensorResult result;
  result.code = static_cast<std::uint8_t>(code);
  result.message = text;
  return result;
}

}  // namespace

struct CalibrationServer::Impl {
  Impl(ros::NodeHandle nh, CompensationPipeline& target, bool is_live)
      : pipeline(target),
        live(is_live),
        server(nh, names::CALIBRATE_SENSOR,
               boost::function<void(Handle)>([this](Handle handle) { onGoal(handle); }),
               boost::function<void(Handle)>([this](Handle handle) {
                 if (active && *active == handle) return pipeline.cancelCalibration();
                 if (isWaiting(handle))
                   handle.setCanceled(resultOf(Code::cancelled, "cancelled before its start"));
                 remove(handle);
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
    waiting.push_back(handle);
    pipeline.push(calibrationGoal(message, toSec(message.header.stamp), toSec(ros::Time::now())),
                  [this, handle](bool free) { return begin(handle, free); });
  }

  /// At the stamp of a goal. @return whether it starts; it may have been cancelled before.
  bool begin(Handle handle, bool free) {
    if (!isWaiting(handle)) return false;
    remove(handle);
    if (!free) {
      const std::string reason = "another step is running";
      handle.setRejected(resultOf(Code::bad_goal, reason), reason);
      return false;
    }
    handle.setAccepted();
    active = handle;
    return true;
  }

  bool isWaiting(const Handle& handle) const {
    return std::find(waiting.begin(), waiting.end(), handle) != waiting.end();
  }
  void remove(const Handle& handle) {
    waiting.erase(std::remove(waiting.begin(), waiting.end(), handle), waiting.end());
  }
  void refuseWaiting(Code code, const std::string& reason) {
    for (Handle& handle : waiting) handle.setRejected(resultOf(code, reason), reason);
    waiting.clear();
  }

  std::string file() const { return active && live ? active->getGoal()->file : ""; }

  /// Writes the calibration and the measurements that it was fitted to. @throws Error.
  void write(const SpindleSensorCalibration& calibration) const {
    const std::string to = file();
    if (to.empty()) return;
    writeSpindleSensor(calibration, to);
    std::ofstream table(to + ".csv");
    table << pipeline.identification().calibrator().measurementTable();
    table.close();
    if (!table) throw Error(to + ".csv: cannot write");
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
  bool live;
  std::string last_message = "no calibration yet";
  std::vector<Handle> waiting;  // for their stamps
  std::optional<Handle> active;
  Server server;
};

CalibrationServer::CalibrationServer(ros::NodeHandle nh, CompensationPipeline& pipeline, bool live)
    : impl_(std::make_unique<Impl>(std::move(nh), pipeline, live)) {
}

CalibrationServer::~CalibrationServer() = default;

const std::string& CalibrationServer::lastMessage() const {
  return impl_->last_message;
}

void CalibrationServer::finish(const CalibrationResult& result) {
  smartmill_msgs::CalibrateForceSensorResult message = resultOf(result.code, result.message);
  message.readings = static_cast<std::uint32_t>(result.readings);
  if (result.verified) conversion::setPoint(result.error, message.error);
  try {
    const bool in_spindle = impl_->pipeline.forces().spindle().isInUse();
    if (result.calibration) {
      impl_->write(*result.calibration);
    } else if (result.memory && !impl_->file().empty()) {
      if (in_spindle) {
        writeSpindleSensor(impl_->pipeline.identification().calibrator().base(), impl_->file());
      } else {
        writeMemorySchedule(*result.memory, impl_->file());
      }
    }
    if (result.matrix && !impl_->file().empty())
      writeTapFile(impl_->pipeline.identification().plate().taps(), impl_->file());
  } catch (const Error& e) {
    message.code = message.FIT_FAILED;
    message.message = e.what();
  }
  impl_->end(message);
}

void CalibrationServer::abort(const std::string& reason) {
  if (impl_->live) impl_->refuseWaiting(Code::bad_data, reason);
  if (!impl_->active) return;
  const bool running = impl_->pipeline.identification().calibrator().active();
  impl_->end(resultOf(Code::bad_data, reason));
  if (running) impl_->pipeline.cancelCalibration();
}

void CalibrationServer::restart() {
  const std::string reason = "time jumped back: the recording was restarted";
  impl_->refuseWaiting(Code::cancelled, reason);
  if (impl_->active) impl_->end(resultOf(Code::cancelled, reason));
}

}  // namespace smartmill::kalman
