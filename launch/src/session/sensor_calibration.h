#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include <ros/ros.h>
#include <smartmill_msgs/CalibrateForceSensorAction.h>
#include <smartmill_msgs/ForceSensorState.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/OperatorDone.h>

#include "session/machine_driver.h"
#include "smartmill_launch/session/calibration_plan.h"

namespace smartmill::session {

/// Runs the stages of a calibration plan by kalman/calibrate, taps of kalman/measure_frf and the operator: by
/// the service operator/act where there is one, else by a request in words and the service session/done.
class SensorCalibration {
 public:
  using Announce = std::function<void(const std::string&)>;
  /// @param announce shows a request to the operator
  SensorCalibration(ros::NodeHandle nh, const CalibrationParameters& parameters, const MachineDriver& driver,
                    Client<smartmill_msgs::MeasureFrfAction>& taps, Announce announce);

  /// What is missing for the calibration; empty: nothing.
  std::string missing();
  /// @param timeout [s] of the taps in one direction @return result of the last step. @throws Error
  std::string run(const CalibrationStage& stage, double timeout);
  /// @throws Error with the reason when the node publishes no force yet.
  void requireCalibrated();
  /// Latest state of the sensor.
  std::optional<smartmill_msgs::ForceSensorState> state() const;

 private:
  void askOperator(const CalibrationStep& step);
  std::string calibrate(const CalibrationStep& step);
  void tap(const CalibrationStep& step, double timeout);

  ros::NodeHandle nh_;
  CalibrationParameters parameters_;
  const MachineDriver& driver_;
  Client<smartmill_msgs::MeasureFrfAction>& taps_;
  Announce announce_;
  Client<smartmill_msgs::CalibrateForceSensorAction> calibrate_;
  mutable std::mutex mutex_;  // guards state_ and request_
  std::optional<smartmill_msgs::ForceSensorState> state_;
  std::string request_;  // open, in words
  ros::Subscriber subscriber_;
  ros::ServiceServer done_server_;
};

}  // namespace smartmill::session
