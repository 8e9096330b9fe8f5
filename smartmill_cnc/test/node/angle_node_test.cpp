// An encoder that fails and a controller that takes over: spindle/angle and diagnostics out.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include <cmath>
#include <string>
#include <vector>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

constexpr double RATE = 10000.0, SPEED = 420.0;
constexpr int BLOCK = 100;

double timeOf(int number, int sample) {
  return 1000.0 + (number * BLOCK + sample) / RATE;
}

smartmill_msgs::SampleBlock counts(int number) {
  smartmill_msgs::SampleBlock block;
  block.header.stamp = ros::Time(timeOf(number, 0));
  block.sample_rate = RATE;
  block.first_index = static_cast<std::uint64_t>(number) * BLOCK;
  block.channels = {"encoder"};
  block.units = {"1"};
  for (int i = 0; i < BLOCK; ++i)
    block.samples.push_back(std::floor(SPEED * timeOf(number, i) / units::TWO_PI * 4096.0));
  return block;
}

smartmill_msgs::SpindleAngle position(int number) {
  smartmill_msgs::SpindleAngle angle;
  angle.header.stamp = ros::Time(timeOf(number, 90));
  angle.angle = std::fmod(SPEED * timeOf(number, 90), units::TWO_PI);
  angle.speed = SPEED;
  return angle;
}

TEST(AngleNode, TheControllerTakesOverAndItIsSaid) {
  ros::NodeHandle nh;
  std::vector<smartmill_msgs::SpindleAngle> angles;
  std::string diagnosed, announced;
  const auto angle = nh.subscribe<smartmill_msgs::SpindleAngle>(
      names::SPINDLE_ANGLE, 10000,
      [&](const smartmill_msgs::SpindleAngle::ConstPtr& m) { angles.push_back(*m); });
  const auto diagnostics = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
        for (const auto& status : m->status) {
          if (status.name.find("spindle angle") == std::string::npos) continue;
          diagnosed = status.message;
          if (diagnosed.find(" in place of ") != std::string::npos) announced = diagnosed;
        }
      });
  auto encoder = nh.advertise<smartmill_msgs::SampleBlock>("daq/encoder", 1000);
  auto controller = nh.advertise<smartmill_msgs::SpindleAngle>("cnc/spindle_angle", 1000);
  ASSERT_TRUE(eventually(
      [&] {
        return encoder.getNumSubscribers() > 0 && controller.getNumSubscribers() > 0 &&
               angle.getNumPublishers() > 0;
      },
      ros::spinOnce));
  int number = 0;
  ASSERT_TRUE(eventually(
      [&] {
        encoder.publish(counts(number));
        controller.publish(position(number++));
        return diagnosed == "by encoder";
      },
      ros::spinOnce))
      << diagnosed;
  const int failed = number;
  ASSERT_TRUE(eventually(
      [&] {
        controller.publish(position(number++));
        return diagnosed == "by controller";
      },
      ros::spinOnce))
      << diagnosed;
  EXPECT_EQ(announced.rfind("controller in place of encoder: no reading for 0.1", 0), 0u) << announced;
  for (const auto& reading : angles) {
    const double time = reading.header.stamp.toSec();
    EXPECT_NEAR(std::remainder(reading.angle - SPEED * time, units::TWO_PI), 0.0, 0.01) << time;
  }
  EXPECT_GT(angles.back().header.stamp.toSec(), timeOf(failed, 0));
}

}  // namespace
}  // namespace smartmill::cnc

int main(int argc, char** argv) {
  ros::init(argc, argv, "angle_node_test");
  ros::NodeHandle keeps_alive;
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
