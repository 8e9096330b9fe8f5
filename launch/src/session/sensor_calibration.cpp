#include "session/sensor_calibration.h"

#include <utility>

#include <smartmill_msgs/OperatorAction.h>
#include <boost/function.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/modal/results.h"
#include "smartmill_core/names.h"
#include "smartmill_recording/conversion/fields.h"

namespace smartmill::session {
namespace {

using Kind = CalibrationStep::Kind;
using smartmill_msgs::CalibrateForceSensorGoal;
using smartmill_msgs::OperatorDone;

std::uint8_t actionOf(Kind kind) {
  using Request = smartmill_msgs::OperatorAction::Request;
  switch (kind) {
    case Kind::hang_weight:
      return Request::HANG_WEIGHT;
    case Kind::press_workpiece:
      return Request::PRESS_WORKPIECE;
    case Kind::change_tool:
      return Request::CHANGE_TOOL;
    default:
      return Request::TAP_POINT;
  }
}

}  // namespace

SensorCalibration::SensorCalibration(ros::NodeHandle nh, const CalibrationParameters& parameters,
                                     const MachineDriver& driver,
                                     Client<smartmill_msgs::MeasureFrfAction>& taps, Announce announce)
    : nh_(std::move(nh)),
      parameters_(parameters),
      driver_(driver),
      taps_(taps),
      announce_(std::move(announce)),
      calibrate_(nh_, names::CALIBRATE_SENSOR, false),
      subscriber_(nh_.subscribe<smartmill_msgs::ForceSensorState>(
          names::FORCE_SENSOR, 10,
          boost::function<void(const smartmill_msgs::ForceSensorState&)>([this](const auto& message) {
            const std::lock_guard<std::mutex> lock(mutex_);
            state_ = message;
          }))),
      done_server_(nh_.advertiseService(
          names::OPERATOR_DONE, boost::function<bool(OperatorDone::Request&, OperatorDone::Response&)>(
                                    [this](const auto& /*request*/, OperatorDone::Response& response) {
                                      const std::lock_guard<std::mutex> lock(mutex_);
                                      response.code = request_.empty() ? OperatorDone::Response::NOTHING
                                                                       : OperatorDone::Response::OK;
                                      response.message =
                                          request_.empty() ? "no request is open" : "done: " + request_;
                                      request_.clear();
                                      return true;
                                    }))) {
}

std::optional<smartmill_msgs::ForceSensorState> SensorCalibration::state() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return state_;
}

std::string SensorCalibration::missing() {
  if (!calibrate_.isServerConnected()) return std::string("action ") + names::CALIBRATE_SENSOR;
  const auto now = state();
  if (!now) return std::string("data on ") + names::FORCE_SENSOR;
  if (now->sensor != parameters_.sensor)
    return "sensor " + parameters_.sensor + " in the kalman node (it uses sensor " + now->sensor + ")";
  return "";
}

std::string SensorCalibration::run(const CalibrationStage& stage, double timeout) {
  std::string result;
  for (const CalibrationStep& step : stage.steps) {
    if (step.isManual()) {
      askOperator(step);
    } else if (step.kind == Kind::taps) {
      tap(step, timeout);
    } else {
      result = calibrate(step);
    }
  }
  return result;
}

void SensorCalibration::askOperator(const CalibrationStep& step) {
  smartmill_msgs::OperatorAction service;
  service.request.action = actionOf(step.kind);
  conversion::setPoint(step.load, service.request.load);
  conversion::setPoint(step.point, service.request.point);
  service.request.length = step.length;
  service.request.text = step.request();
  if (ros::service::exists(nh_.resolveName(names::OPERATOR_ACTION), false)) {
    if (!driver_.callService(names::OPERATOR_ACTION, service, parameters_.operator_timeout))
      throw Error(std::string(names::OPERATOR_ACTION) + ": no answer to '" + service.request.text + "'");
    if (service.response.code != smartmill_msgs::OperatorAction::Response::OK)
      throw Error(std::string(names::OPERATOR_ACTION) + ": " + service.response.message);
    return;
  }
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    request_ = service.request.text;
  }
  announce_(service.request.text + "; then call " + nh_.resolveName(names::OPERATOR_DONE));
  const auto done = [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return request_.empty();
  };
  if (!driver_.waitUntil(done, parameters_.operator_timeout))
    throw Error(std::string(names::OPERATOR_DONE) + ": no answer to '" + service.request.text + "'");
}

std::string SensorCalibration::calibrate(const CalibrationStep& step) {
  CalibrateForceSensorGoal goal;
  goal.step = step.kind == Kind::fit      ? CalibrateForceSensorGoal::FIT
              : step.kind == Kind::verify ? CalibrateForceSensorGoal::VERIFY
              : step.kind == Kind::point  ? CalibrateForceSensorGoal::POINT
                                          : CalibrateForceSensorGoal::READING;
  goal.test = step.test;
  goal.length = step.length;
  conversion::setPoint(step.load, goal.load);
  conversion::setPoint(step.point, goal.point);
  goal.reference = step.reference;
  goal.duration = parameters_.reading_time;
  goal.file = parameters_.file;
  if (step.kind == Kind::reading) driver_.waitUntil([] { return false; }, parameters_.load_settling);
  constexpr double ANSWER = 60.0;  // [s] beyond the reading: a fit on a busy computer
  return driver_.call(calibrate_, names::CALIBRATE_SENSOR, goal, parameters_.reading_time + ANSWER).message;
}

void SensorCalibration::tap(const CalibrationStep& step, double timeout) {
  smartmill_msgs::MeasureFrfGoal goal;
  goal.point = POINT_FORCE_SENSOR;
  goal.direction = step.direction;
  goal.hits = static_cast<std::uint32_t>(parameters_.point_hits);
  driver_.call(taps_, names::MEASURE_SENSOR_FRF, goal, timeout);
}

void SensorCalibration::requireCalibrated() {
  const auto calibrated = [this] {
    const auto now = state();
    return now && now->calibrated;
  };
  if (driver_.waitUntil(calibrated, MachineDriver::SERVICE_WAIT)) return;
  const auto now = state();
  throw Error("force sensor " + parameters_.sensor + ": " + (now ? now->message : "no state"));
}

}  // namespace smartmill::session
