// Pulses in, spindle/angle and diagnostics out.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/units.h"

namespace smartmill::cnc {
namespace {

constexpr double RATE = 25600.0;  // [Hz]
constexpr int BLOCK = 256;

/// Block of a spindle at 6000 rpm; silent: the channel is stuck.
smartmill_msgs::SampleBlock blockOf(int number, bool silent) {
  smartmill_msgs::SampleBlock block;
  block.header.stamp = ros::Time(1000.0 + number * BLOCK / RATE);
  block.sample_rate = RATE;
  block.first_index = static_cast<std::uint64_t>(number) * BLOCK;
  block.channels = {"tachometer"};
  block.units = {"V"};
  for (int i = 0; i < BLOCK; ++i) {
    const double turned = 100.0 * (number * BLOCK + i) / RATE + 0.37;
    block.samples.push_back(!silent && turned - std::floor(turned) < 0.1 ? 5.0 : 0.0);
  }
  return block;
}

TEST(TachometerNode, GivesTheAngleAndReportsAStuckChannel) {
  ros::NodeHandle nh;
  std::vector<smartmill_msgs::SpindleAngle> angles;
  std::string diagnosed;
  const auto angle = nh.subscribe<smartmill_msgs::SpindleAngle>(
      names::SPINDLE_ANGLE, 10000,
      [&](const smartmill_msgs::SpindleAngle::ConstPtr& m) { angles.push_back(*m); });
  const auto diagnostics = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
        for (const auto& status : m->status) {
          if (status.name.find("pulse tachometer") != std::string::npos) diagnosed = status.message;
        }
      });
  auto blocks = nh.advertise<smartmill_msgs::SampleBlock>(names::TACHOMETER, 1000);
  auto states = nh.advertise<smartmill_msgs::CncState>(names::CNC_STATE, 1000);
  ASSERT_TRUE(eventually(
      [&] {
        return blocks.getNumSubscribers() > 0 && states.getNumSubscribers() > 0 &&
               angle.getNumPublishers() > 0;
      },
      ros::spinOnce));
  smartmill_msgs::CncState state;
  state.connected = true;
  state.spindle_speed = units::TWO_PI * 100.0;
  states.publish(state);
  int number = 0;
  for (; number < 50; ++number) blocks.publish(blockOf(number, false));
  // 49 or 50 pulses in 0.5 s; the first reading is at the fourth.
  ASSERT_TRUE(eventually([&] { return angles.size() >= 46; }, ros::spinOnce)) << angles.size();
  EXPECT_NEAR(angles.back().speed, units::TWO_PI * 100.0, 0.1);
  const double turned = 100.0 * (angles.back().header.stamp.toSec() - 1000.0) + 0.37;
  EXPECT_NEAR(std::remainder(angles.back().angle - units::TWO_PI * turned, units::TWO_PI), 0.0, 0.02);
  const std::size_t before = angles.size();
  ASSERT_TRUE(eventually(
      [&] {
        states.publish(state);
        blocks.publish(blockOf(number++, true));
        return diagnosed.find("no pulses while the controller reports a turning spindle") !=
               std::string::npos;
      },
      ros::spinOnce))
      << diagnosed;
  EXPECT_EQ(angles.size(), before);
}

}  // namespace
}  // namespace smartmill::cnc

int main(int argc, char** argv) {
  ros::init(argc, argv, "tachometer_node_test");
  ros::NodeHandle keeps_alive;
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
