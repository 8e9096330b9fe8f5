// The force sensor in the spindle of the simulated machine, calibrated by the actions of kalman_node.

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/CalibrateForceSensorAction.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/PanelKey.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace {

using smartmill_msgs::CalibrateForceSensorGoal;
using Calibrate = actionlib::SimpleActionClient<smartmill_msgs::CalibrateForceSensorAction>;
using Measure = actionlib::SimpleActionClient<smartmill_msgs::MeasureFrfAction>;

constexpr double TIMEOUT = 120.0;  // [s] time limit on a busy computer

bool pressKey(ros::NodeHandle& nh, const std::string& key, const std::vector<double>& values) {
  ros::ServiceClient client = nh.serviceClient<smartmill_msgs::PanelKey>("sim/panel/" + key);
  if (!client.waitForExistence(ros::Duration(TIMEOUT))) return false;
  smartmill_msgs::PanelKey call;
  call.request.values = values;
  return client.call(call) && call.response.code == smartmill_msgs::PanelKey::Response::OK;
}

smartmill_msgs::CalibrateForceSensorResult calibrationResult(Calibrate& client,
                                                             CalibrateForceSensorGoal goal) {
  goal.header.stamp = ros::Time::now();
  client.sendGoal(goal);
  EXPECT_TRUE(client.waitForResult(ros::Duration(TIMEOUT)));
  return *client.getResult();
}

void measureLoads(ros::NodeHandle& nh, Calibrate& client, double length, bool reference,
                  std::uint32_t& test) {
  EXPECT_TRUE(pressKey(nh, "tool_length", {length}));
  for (int axis = 0; axis < 3; ++axis, ++test) {
    for (const double load : {0.0, 150.0, 300.0, 0.0}) {
      CalibrateForceSensorGoal goal;
      (axis == 0 ? goal.load.x : axis == 1 ? goal.load.y : goal.load.z) = load;
      goal.test = test;
      goal.length = length;
      goal.reference = reference;
      goal.duration = 0.1;
      EXPECT_TRUE(pressKey(nh, reference ? "press_workpiece" : "hang_weight",
                           {goal.load.x, goal.load.y, goal.load.z}));
      ros::Duration(0.15).sleep();  // decay of the modes
      const auto result = calibrationResult(client, goal);
      EXPECT_EQ(result.code, result.OK) << result.message;
    }
  }
}

TEST(SpindleSensor, IsCalibratedOnTheRunningMachine) {
  ros::NodeHandle nh;
  Calibrate calibrate(nh, smartmill::names::CALIBRATE_SENSOR, true);
  ASSERT_TRUE(calibrate.waitForServer(ros::Duration(TIMEOUT)));
  ros::Publisher conditions =
      nh.advertise<smartmill_msgs::CuttingCondition>(smartmill::names::CUTTING_CONDITION, 1, true);
  smartmill_msgs::CuttingCondition air;
  air.header.stamp = ros::Time::now();
  air.kind = air.NONE;
  conditions.publish(air);

  // A fit without measurements fails with a message.
  CalibrateForceSensorGoal fit;
  fit.step = fit.FIT;
  const auto early = calibrationResult(calibrate, fit);
  EXPECT_EQ(early.code, early.FIT_FAILED);
  EXPECT_FALSE(early.message.empty());

  std::uint32_t test = 0;
  for (const double length : {0.110, 0.139, 0.170}) measureLoads(nh, calibrate, length, false, test);
  const smartmill::TemporaryFolder folder;
  fit.file = folder.file("spindle.yaml");
  const auto found = calibrationResult(calibrate, fit);
  ASSERT_EQ(found.code, found.OK) << found.message;
  EXPECT_EQ(found.readings, 36u);

  // Another tool length, by the reference sensor (Burzoni 3.2.1: 5 %).
  measureLoads(nh, calibrate, 0.125, true, test);
  CalibrateForceSensorGoal verify;
  verify.step = verify.VERIFY;
  const auto verified = calibrationResult(calibrate, verify);
  EXPECT_EQ(verified.code, verified.OK) << verified.message;
  EXPECT_LT(std::max({verified.error.x, verified.error.y, verified.error.z}), 0.05);

  // Dynamics by taps on the tool; the fit after them includes the frequency response of the cross-talk.
  EXPECT_TRUE(pressKey(nh, "hang_weight", {0.0, 0.0, 0.0}));
  EXPECT_TRUE(pressKey(nh, "tool_length", {0.139}));
  ros::Duration(0.5).sleep();
  Measure measure(nh, smartmill::names::MEASURE_SENSOR_FRF, true);
  ASSERT_TRUE(measure.waitForServer(ros::Duration(TIMEOUT)));
  smartmill_msgs::MeasureFrfGoal taps;
  taps.header.stamp = ros::Time::now();
  taps.point = "force_sensor";
  taps.direction = "y";
  taps.hits = 4;
  measure.sendGoal(taps);
  ASSERT_TRUE(measure.waitForResult(ros::Duration(TIMEOUT)));
  const auto& modes = *measure.getResult();
  ASSERT_EQ(modes.code, modes.OK) << modes.message;
  ASSERT_GE(modes.modes.modes.size(), 2u);
  EXPECT_NEAR(modes.modes.modes[0].frequency, 460.0, 5.0);
  EXPECT_NEAR(modes.modes.modes[1].frequency, 1080.0, 10.0);
  const auto with_dynamics = calibrationResult(calibrate, fit);
  ASSERT_EQ(with_dynamics.code, with_dynamics.OK) << with_dynamics.message;
  std::stringstream written;
  written << std::ifstream(fit.file).rdbuf();
  EXPECT_NE(written.str().find("format: smartmill-spindle-sensor/1"), std::string::npos);
  EXPECT_TRUE(std::ifstream(fit.file + ".csv").good());

  // A weight is measured with its force in the machine frame.
  ros::Duration(0.5).sleep();
  smartmill_msgs::CuttingCondition cut = air;
  cut.header.stamp = ros::Time::now();
  cut.kind = cut.CUT;  // the zero is no longer updated
  cut.teeth = 4;
  conditions.publish(cut);
  ros::Duration(0.3).sleep();
  EXPECT_TRUE(pressKey(nh, "hang_weight", {200.0, 0.0, 0.0}));
  ros::Duration(0.5).sleep();
  const auto block = ros::topic::waitForMessage<smartmill_msgs::ForceBlock>(
      smartmill::names::FORCE_COMPENSATED, nh, ros::Duration(TIMEOUT));
  ASSERT_TRUE(block);
  double mean = 0.0;
  for (const double f : block->fx) mean += f / static_cast<double>(block->fx.size());
  EXPECT_NEAR(mean, 200.0, 10.0);
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "spindle_sensor_test");
  ros::NodeHandle keep_ros_running;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
