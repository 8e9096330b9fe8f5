#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/WrenchStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/modal/modal_model.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/follower.h"

namespace smartmill {
namespace {

using Blocks = std::map<std::uint64_t, smartmill_msgs::ForceBlock>;  // by first index

ros::Subscriber collect(ros::NodeHandle& nh, const std::string& topic, Blocks& blocks) {
  return nh.subscribe<smartmill_msgs::ForceBlock>(
      topic, 2000, [&blocks](const smartmill_msgs::ForceBlock::ConstPtr& m) { blocks[m->first_index] = *m; });
}

// A sine at the sensor's first mode of 930 Hz, four times the spindle's frequency; amplitude in the sensor 15
// times too large.
TEST(KalmanNode, compensatesInTheMachinesFrame) {
  ros::NodeHandle nh;
  Blocks compensated, measured;
  std::vector<geometry_msgs::WrenchStamped> wrenches;
  const auto sub1 = collect(nh, names::FORCE_COMPENSATED, compensated),
             sub2 = collect(nh, names::FORCE_MEASURED, measured);
  const auto sub3 = nh.subscribe<geometry_msgs::WrenchStamped>(
      names::FORCE_WRENCH, 2000,
      [&](const geometry_msgs::WrenchStamped::ConstPtr& m) { wrenches.push_back(*m); });
  auto blocks = nh.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 0);
  auto angles = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 0);
  Followers node({names::absolute("kalman")});
  node.begin();
  node.expect(blocks);
  node.expect(angles);
  for (const ros::Subscriber& listener : {sub1, sub2, sub3}) node.expect(listener);

  ModalModel sensor;
  sensor.modes = {{930.0, 0.03, 0.9}};
  sensor.direct = 0.1;
  const std::complex<double> passed = sensor.response(930.0);
  constexpr double RATE = 25600.0;
  constexpr int BLOCK = 256, COUNT = 400;
  const double start = std::floor(ros::Time::now().toSec());
  for (int b = 0; b < COUNT; ++b) {
    smartmill_msgs::SampleBlock block;
    block.header.stamp = ros::Time(start + b * BLOCK / RATE);
    block.header.frame_id = "dynamometer";
    block.sample_rate = RATE;
    block.first_index = static_cast<std::uint64_t>(b) * BLOCK;
    block.channels = {"fx", "fy", "fz"};
    block.units = {"N", "N", "N"};
    for (int i = 0; i < BLOCK; ++i) {
      const double phase = units::TWO_PI * 930.0 * (b * BLOCK + i) / RATE;
      block.samples.insert(block.samples.end(), {(passed * std::polar(100.0, phase)).real(), 0.0, 0.0});
    }
    smartmill_msgs::SpindleAngle angle;
    angle.header.stamp = block.header.stamp;
    angle.speed = units::TWO_PI * 232.5;
    angle.angle = std::fmod(angle.speed * b * BLOCK / RATE, units::TWO_PI);
    node.publish(angles, angle);
    node.publish(blocks, block);
    ros::spinOnce();
  }
  node.end();
  ASSERT_TRUE(eventually(
      [&] { return compensated.count((COUNT - 1) * BLOCK) > 0 && measured.count((COUNT - 1) * BLOCK) > 0; },
      ros::spinOnce));
  const smartmill_msgs::ForceBlock& last = compensated[(COUNT - 1) * BLOCK];
  EXPECT_EQ(last.header.frame_id, "machine");
  EXPECT_EQ(last.status, smartmill_msgs::ForceBlock::COMPENSATED);
  const auto largest = [](const std::vector<double>& v) { return *std::max_element(v.begin(), v.end()); };
  // 4 s after the start; the slowest harmonic, next to the sensor's zero, settles with 0.2 s.
  EXPECT_NEAR(largest(last.fy), 100.0, 0.5);
  EXPECT_LT(std::abs(largest(last.fx)), 0.5);
  EXPECT_NEAR(largest(measured[(COUNT - 1) * BLOCK].fy), 100.0 * std::abs(passed), 15.0);
  EXPECT_GT(wrenches.size(), 300u);
  EXPECT_EQ(wrenches.back().header.frame_id, "machine");
}

// The pair of x shows force / 18.002, that of y in both: eq. 3-5 at 139 mm by hand. A block in which a sensor
// is unloaded comes out as NaN, and the diagnostics report it.
TEST(KalmanNode, takesSixSensorsInTheSpindle) {
  ros::NodeHandle nh("/spindle_sensor");
  Blocks compensated, measured;
  bool reported = false;
  const auto sub1 = collect(nh, names::FORCE_COMPENSATED, compensated),
             sub2 = collect(nh, names::FORCE_MEASURED, measured);
  const auto sub3 = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
        for (const auto& status : m->status)
          reported = reported || status.message.find("unloaded or overloaded") != std::string::npos;
      });
  auto blocks = nh.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 0);
  auto angles = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 0);
  Followers node({"/spindle_sensor/kalman"});
  node.begin();
  node.expect(blocks);
  node.expect(angles);
  for (const ros::Subscriber& listener : {sub1, sub2, sub3}) node.expect(listener);
  constexpr int COUNT = 60, BAD = 50;
  const double start = std::floor(ros::Time::now().toSec());
  for (int b = 0; b < COUNT; ++b) {
    smartmill_msgs::SampleBlock block;
    block.header.stamp = ros::Time(start + 0.01 * b);
    block.header.frame_id = "dynamometer";
    block.sample_rate = 25600.0;
    block.first_index = 256u * static_cast<unsigned>(b);
    block.channels = {"x1", "x2", "y1", "y2", "z1", "z2"};
    block.units.assign(6, "N");
    const double fy = b == BAD ? 950.0 : 180.0;  // 950 N take 52.9 N off a sensor of 50 N
    const double py = fy / 17.961, px = 360.0 / 18.002 + fy / 27.726;
    for (int i = 0; i < 256; ++i) block.samples.insert(block.samples.end(), {px, -px, -py, py, 1.0, 1.0});
    smartmill_msgs::SpindleAngle angle;
    angle.header.stamp = block.header.stamp;
    node.publish(angles, angle);  // at rest: samples pass through
    node.publish(blocks, block);
    ros::spinOnce();
  }
  node.end();
  ASSERT_TRUE(
      eventually([&] { return compensated.count(256 * (COUNT - 1)) && measured.count(256 * (COUNT - 1)); },
                 ros::spinOnce));
  // x of the sensor is y of the machine.
  const smartmill_msgs::ForceBlock& good = measured[256 * 40];
  EXPECT_NEAR(good.fy[100], 360.0, 0.01);
  EXPECT_NEAR(good.fx[100], -180.0, 0.01);
  EXPECT_NEAR(good.fz[100], 62.46, 0.01);
  for (auto* stream : {&measured, &compensated}) {
    EXPECT_TRUE(std::isnan((*stream)[256 * BAD].fx[0]));
    EXPECT_TRUE(std::isnan((*stream)[256 * BAD].fz[255]));
    EXPECT_FALSE(std::isnan((*stream)[256 * (BAD + 1)].fx[0]));
  }
  EXPECT_TRUE(eventually([&] { return reported; }, ros::spinOnce));
}

// 2100 input blocks are 4200 force blocks, 4000 of which may wait. The last 0.05 s wait for their order. A
// block in another unit counts against its own topic, whatever releases it.
TEST(KalmanNode, countsBlocksWithoutATransformAndBadBlocks) {
  ros::NodeHandle nh("/no_transform");
  int dropped = 0;
  std::string input;
  const auto sub = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 100, [&](const diagnostic_msgs::DiagnosticArray::ConstPtr& m) {
        for (const auto& status : m->status) {
          if (status.name.find("no_transform") == std::string::npos) continue;
          for (const auto& value : status.values) {
            if (value.key == "blocks dropped for want of a transform") dropped = std::stoi(value.value);
            if (value.key == names::DYNAMOMETER) input = value.value;
          }
        }
      });
  auto blocks = nh.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 0);
  auto angles = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 0);
  ASSERT_TRUE(eventually([&] { return blocks.getNumSubscribers() > 0 && angles.getNumSubscribers() > 0; },
                         ros::spinOnce));
  constexpr int COUNT = 2100;
  for (int b = 0; b < COUNT; ++b) {
    smartmill_msgs::SampleBlock block;
    block.header.stamp = ros::Time(1000.0 + 0.01 * b);
    block.header.frame_id = "elsewhere";
    block.sample_rate = 200.0;
    block.first_index = 2u * static_cast<unsigned>(b);
    block.channels = {"fx", "fy", "fz"};
    block.units = {"N", "N", "N"};
    block.samples.assign(6, 1.0);
    smartmill_msgs::SpindleAngle angle;
    angle.header.stamp = block.header.stamp;
    angles.publish(angle);  // at rest: samples pass through
    if (b == COUNT / 2) block.units[0] = "V";
    blocks.publish(block);
  }
  EXPECT_TRUE(eventually([&] { return dropped >= 180; }, ros::spinOnce)) << dropped;
  EXPECT_LE(dropped, 200);
  EXPECT_NE(input.find(" 1 refused"), std::string::npos) << input;
}

TEST(KalmanNode, refusesAStringForANumber) {
  // The node `wrong` got noise_rms: 1e-2, which YAML makes a string; it ended before it advertised anything.
  std::vector<std::string> nodes;
  ASSERT_TRUE(eventually(
      [&] {
        nodes.clear();
        return ros::master::getNodes(nodes) &&
               std::count(nodes.begin(), nodes.end(), "/smartmill/kalman") == 1 &&
               std::count(nodes.begin(), nodes.end(), "/smartmill/wrong") == 0;
      },
      ros::spinOnce));
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "kalman_node_test");
  const ros::NodeHandle nh;
  return RUN_ALL_TESTS();
}
