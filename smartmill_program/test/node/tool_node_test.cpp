// Forces of a tool that loses a tooth in, tool/condition, diagnostics and the request of a feed hold out.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/FeedHold.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <smartmill_msgs/ToolCondition.h>

#include <cmath>
#include <string>
#include <vector>

#include "../tool/cutting_teeth.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"

namespace smartmill::program {
namespace {

using units::TWO_PI;

constexpr double RATE = 10000.0, SPEED = 50.0 * TWO_PI;  // [Hz], [rad/s]
constexpr int BLOCK = 100;
constexpr double LOST = 1.003;  // [s]

TEST(ToolNode, ReportsALostToothAndRequestsAFeedHold) {
  ros::NodeHandle nh;
  std::vector<smartmill_msgs::ToolCondition> reports;
  std::string diagnosed;
  int holds = 0;
  auto hold = nh.advertiseService<smartmill_msgs::FeedHold::Request, smartmill_msgs::FeedHold::Response>(
      names::FEED_HOLD, [&](smartmill_msgs::FeedHold::Request&, smartmill_msgs::FeedHold::Response& answer) {
        ++holds;
        answer.code = smartmill_msgs::FeedHold::Response::NOT_ARMED;
        answer.message = "motion is not armed";
        return true;
      });
  const auto condition = nh.subscribe<smartmill_msgs::ToolCondition>(
      names::TOOL_CONDITION, 100,
      [&](const smartmill_msgs::ToolCondition::ConstPtr& m) { reports.push_back(*m); });
  const auto diagnostics = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
        for (const auto& status : m->status)
          if (status.message.find("is lost") != std::string::npos) diagnosed = status.message;
      });
  auto forces = nh.advertise<smartmill_msgs::ForceBlock>(names::FORCE_COMPENSATED, 1000);
  auto angles = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 10000);
  ASSERT_TRUE(eventually(
      [&] {
        return forces.getNumSubscribers() > 0 && angles.getNumSubscribers() > 0 &&
               condition.getNumPublishers() > 0;
      },
      ros::spinOnce));
  CuttingTeeth teeth;
  teeth.missing = 2;
  teeth.missing_from = SPEED * LOST;
  for (int number = 0; number < 150; ++number) {
    smartmill_msgs::ForceBlock block;
    const double start = number * BLOCK / RATE;
    block.header.stamp = ros::Time(1000.0 + start);
    block.sample_rate = RATE;
    block.first_index = static_cast<std::uint64_t>(number) * BLOCK;
    block.status = smartmill_msgs::ForceBlock::COMPENSATED;
    for (int i = 0; i < BLOCK; ++i) {
      const double time = start + i / RATE;
      const ForceSample sample = teeth.at(time, SPEED * time);
      block.fx.push_back(sample.fx);
      block.fy.push_back(sample.fy);
      block.fz.push_back(0.0);
    }
    forces.publish(block);
    smartmill_msgs::SpindleAngle angle;
    angle.header.stamp = block.header.stamp;
    angle.angle = std::fmod(SPEED * start, TWO_PI);
    angle.speed = SPEED;
    angles.publish(angle);
  }
  ASSERT_TRUE(eventually([&] { return !reports.empty() && holds > 0 && !diagnosed.empty(); }, ros::spinOnce));
  EXPECT_TRUE(reports[0].broken);
  EXPECT_EQ(reports[0].tooth, 3u);
  EXPECT_EQ(reports[0].teeth, 4u);
  EXPECT_LE(reports[0].header.stamp.toSec() - 1000.0, LOST + 2.0 * TWO_PI / SPEED);
  EXPECT_TRUE(std::isnan(reports[0].wear));
  EXPECT_EQ(diagnosed, "tooth 3 is lost");
  EXPECT_EQ(holds, 1);
}

}  // namespace
}  // namespace smartmill::program

int main(int argc, char** argv) {
  ros::init(argc, argv, "tool_node_test");
  ros::NodeHandle keeps_alive;
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
