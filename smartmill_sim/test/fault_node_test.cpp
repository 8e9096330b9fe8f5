// Topics and service of fault_node.
#include <sys/wait.h>

#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SetFault.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;
using Response = smartmill_msgs::SetFault::Response;

constexpr double PATIENCE = 120.0;  // [s] for a busy computer

smartmill_msgs::SampleBlock blockOf(int number) {
  smartmill_msgs::SampleBlock block;
  block.header.stamp.fromSec(100.0 + 0.01 * number);
  block.header.frame_id = "dynamometer";
  block.sample_rate = 100.0;
  block.first_index = static_cast<std::uint64_t>(number);
  block.channels = {"fx"};
  block.units = {"N"};
  block.samples = {1.0 + number};
  return block;
}

Response set(const std::string& topic, const std::string& fault) {
  smartmill_msgs::SetFault service;
  service.request.topic = topic;
  service.request.fault = fault;
  EXPECT_TRUE(ros::service::waitForService(names::SET_FAULT, static_cast<int>(1e3 * PATIENCE)));
  EXPECT_TRUE(ros::service::call(names::SET_FAULT, service));
  return service.response;
}

TEST(FaultNode, PassesStreamsWithTheFaultsOfParametersAndService) {
  ros::NodeHandle nh;
  std::vector<smartmill_msgs::SampleBlock> blocks;
  std::size_t angles = 0;
  const boost::function<void(const smartmill_msgs::SampleBlock&)> on_block =
      [&](const smartmill_msgs::SampleBlock& block) { blocks.push_back(block); };
  const boost::function<void(const smartmill_msgs::SpindleAngle&)> on_angle =
      [&](const smartmill_msgs::SpindleAngle&) { ++angles; };
  const ros::Subscriber block_subscriber =
      nh.subscribe<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 1000, on_block);
  const ros::Subscriber angle_subscriber =
      nh.subscribe<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 1000, on_angle);
  const ros::Publisher force =
      nh.advertise<smartmill_msgs::SampleBlock>(names::healthy(names::DYNAMOMETER), 1000);
  const ros::Publisher angle =
      nh.advertise<smartmill_msgs::SpindleAngle>(names::healthy(names::SPINDLE_ANGLE), 1000);
  ASSERT_TRUE(eventually(
      [&] {
        return force.getNumSubscribers() == 1 && angle.getNumSubscribers() == 1 &&
               block_subscriber.getNumPublishers() == 1 && angle_subscriber.getNumPublishers() == 1;
      },
      ros::spinOnce));
  for (int k = 0; k < 100; ++k) force.publish(blockOf(k));
  ASSERT_TRUE(eventually([&] { return blocks.size() == 100; }, ros::spinOnce));
  // From 0.5 s to 0.7 s twice the value: block k has 1 + k.
  EXPECT_EQ(blocks[49].samples[0], 50.0);
  EXPECT_EQ(blocks[51].samples[0], 104.0);
  EXPECT_EQ(blocks[69].samples[0], 140.0);
  EXPECT_EQ(blocks[71].samples[0], 72.0);
  EXPECT_EQ(blocks[51].header.frame_id, "dynamometer");

  EXPECT_EQ(set(names::DYNAMOMETER, "off").code, Response::OK);
  smartmill_msgs::SpindleAngle reading;
  reading.header.stamp.fromSec(100.0);
  for (int k = 100; k < 110; ++k) force.publish(blockOf(k));
  angle.publish(reading);
  ASSERT_TRUE(eventually([&] { return angles == 1; }, ros::spinOnce));
  EXPECT_EQ(set(names::DYNAMOMETER, "").code, Response::OK);
  force.publish(blockOf(110));
  ASSERT_TRUE(eventually([&] { return blocks.size() >= 101; }, ros::spinOnce));
  EXPECT_EQ(blocks.back().first_index, 110u);

  const Response unknown = set("daq/hammer", "off");
  EXPECT_EQ(unknown.code, Response::REFUSED);
  EXPECT_THAT(unknown.message, HasSubstr("daq/hammer does not pass through this node"));
  EXPECT_EQ(set(names::SPINDLE_ANGLE, "swapped").code, Response::REFUSED);
  EXPECT_EQ(set(names::SPINDLE_ANGLE, "loud").code, Response::REFUSED);
}

TEST(FaultNode, RefusesToRunAtAMachine) {
  ros::param::set("/use_sim_time", false);
  FILE* const pipe =
      ::popen("rosrun smartmill_sim fault_node __ns:=/smartmill __name:=faults_at_a_machine 2>&1", "r");
  ASSERT_NE(pipe, nullptr);
  std::string output;
  char piece[256];
  while (std::fgets(piece, sizeof piece, pipe) != nullptr) output += piece;
  const int status = ::pclose(pipe);
  ros::param::set("/use_sim_time", true);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1) << status;
  EXPECT_THAT(output, HasSubstr("/use_sim_time: false, expected true"));
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "fault_node_test");
  return RUN_ALL_TESTS();
}
