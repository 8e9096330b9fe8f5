// Faults of sensors in the running graph are announced under the topic at fault, by the stamps of the data.

#include <regex>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/SetFault.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"

namespace {

using namespace smartmill;

constexpr double PROMPT = 0.5;  // [s] of stamps

struct Case {
  const char *topic, *fault,
      *line;  // how the announcement begins, with the stamp or the age in its first group
};

TEST(Faults, AreAnnouncedUnderTheirTopic) {
  ros::NodeHandle nh("smartmill");
  std::vector<std::string> lines;
  const boost::function<void(const rosgraph_msgs::Log&)> on_log = [&](const rosgraph_msgs::Log& log) {
    if (log.name == names::absolute("kalman")) lines.push_back(log.msg);
  };
  const ros::Subscriber logs = ros::NodeHandle().subscribe<rosgraph_msgs::Log>("/rosout", 1000, on_log);
  double newest = 0.0;  // [s]
  std::size_t blocks = 0;
  const boost::function<void(const smartmill_msgs::ForceBlock&)> on_block =
      [&](const smartmill_msgs::ForceBlock& block) {
        newest = block.header.stamp.toSec();
        ++blocks;
      };
  const ros::Subscriber forces =
      nh.subscribe<smartmill_msgs::ForceBlock>(names::FORCE_COMPENSATED, 1000, on_block);
  ASSERT_TRUE(eventually([&] { return blocks > 100; }, ros::spinOnce));
  EXPECT_TRUE(lines.empty() || lines.back().find("no data") == std::string::npos) << lines.back();

  const std::vector<Case> cases{
      {names::DYNAMOMETER, "garbage", "daq/dynamometer: channel f. has values .* at ([0-9.]+) s"},
      {names::DYNAMOMETER, "stuck", "daq/dynamometer: channel f. repeats one value: stuck at ([0-9.]+) s"},
      {names::DYNAMOMETER, "off", "daq/dynamometer: no data for ([0-9.]+) s of the other inputs.*"},
      {names::SPINDLE_ANGLE, "off", "spindle/angle: no data for ([0-9.]+) s of the other inputs.*"},
      {names::HAMMER, "off", "daq/hammer: no data for ([0-9.]+) s of the other inputs.*"},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(std::string(c.topic) + " " + c.fault);
    lines.clear();
    smartmill_msgs::SetFault service;
    service.request.topic = c.topic;
    service.request.fault = c.fault;
    const double begin = newest;
    ASSERT_TRUE(ros::service::call(names::absolute(names::SET_FAULT), service));
    ASSERT_EQ(service.response.code, smartmill_msgs::SetFault::Response::OK) << service.response.message;
    double announced = 0.0;  // [s] stamp, or age of the last data
    EXPECT_TRUE(eventually(
        [&] {
          for (const std::string& line : lines) {
            std::smatch match;
            if (std::regex_match(line, match, std::regex(c.line))) announced = std::stod(match[1]);
          }
          return announced > 0.0;
        },
        ros::spinOnce));
    // The service takes effect some blocks later.
    EXPECT_LE(announced > 1e6 ? announced - begin : announced, 2.0 * PROMPT);
    for (const std::string& line : lines) {
      EXPECT_FALSE(line.find("no data") != std::string::npos && line.rfind(c.topic, 0) != 0) << line;
    }
    service.request.fault = "";
    ASSERT_TRUE(ros::service::call(names::absolute(names::SET_FAULT), service));
    const double resumed = newest;
    EXPECT_TRUE(eventually([&] { return newest > resumed + 2.0 * PROMPT; }, ros::spinOnce));
  }
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "faults_test");
  ros::NodeHandle keep_ros_running;
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
