// The complete graph with the shipped parameter files and models, as started by pipeline.launch.

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/PredictStability.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <tf2_ros/transform_listener.h>

#include "../src/session/session_parameters.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/names.h"
#include "smartmill_core/parameters/parameter_reader.h"
#include "smartmill_ros/follower.h"
#include "waiting.h"

namespace {

constexpr double TIMEOUT = 120.0;  // [s] time limit on a busy computer

using smartmill::testing::waitFor;

TEST(Pipeline, EveryNodeAcceptsItsParametersAndRuns) {
  std::vector<std::string> nodes;
  for (const char* name : {"cnc", "hammer", "loadmeter", "kalman", "stability", "sim"})
    nodes.push_back(smartmill::names::absolute(name));
  smartmill::Followers followers(nodes);
  // A node that refuses a parameter ends before it answers.
  EXPECT_NO_THROW(followers.begin(TIMEOUT));
  EXPECT_NO_THROW(followers.leave());
}

TEST(Pipeline, StreamsFlowAtTheirRates) {
  ros::NodeHandle nh("smartmill");
  std::map<std::string, int> count;
  std::map<std::string, double> first, last;
  std::vector<ros::Subscriber> subscribers;
  const auto listen = [&](const char* topic, auto example) {
    using Message = decltype(example);
    subscribers.push_back(nh.subscribe<Message>(
        topic, 1000, boost::function<void(const Message&)>([&, topic](const Message& m) {
          const double stamp = m.header.stamp.toSec();
          if (count[topic]++ == 0) first[topic] = stamp;
          last[topic] = stamp;
        })));
  };
  listen(smartmill::names::HAMMER, smartmill_msgs::SampleBlock());
  listen(smartmill::names::DYNAMOMETER, smartmill_msgs::SampleBlock());
  listen(smartmill::names::SPINDLE_ANGLE, smartmill_msgs::SpindleAngle());
  listen(smartmill::names::CNC_STATE, smartmill_msgs::CncState());
  listen(smartmill::names::FORCE_COMPENSATED, smartmill_msgs::ForceBlock());
  ASSERT_TRUE(waitFor(
      [&] {
        return count[smartmill::names::CNC_STATE] > 100 && count[smartmill::names::FORCE_COMPENSATED] > 200;
      },
      TIMEOUT));
  const auto rate = [&](const char* topic) { return (count[topic] - 1) / (last[topic] - first[topic]); };
  // Blocks of 256 samples at 25600 Hz; stamps are of the sample clock, independent of the load of the
  // computer.
  EXPECT_NEAR(rate(smartmill::names::HAMMER), 100.0, 1.0);
  EXPECT_NEAR(rate(smartmill::names::DYNAMOMETER), 100.0, 1.0);
  EXPECT_NEAR(rate(smartmill::names::FORCE_COMPENSATED), 100.0, 1.0);
  EXPECT_GE(rate(smartmill::names::SPINDLE_ANGLE), 100.0);
  // The controller is polled by wall time: less often while the computer is busy.
  EXPECT_TRUE(waitFor(
      [&] {
        if (rate(smartmill::names::CNC_STATE) >= 20.0) return true;
        if (count[smartmill::names::CNC_STATE] > 200) count[smartmill::names::CNC_STATE] = 0;
        return false;
      },
      TIMEOUT));
}

TEST(Pipeline, FramesAreConnected) {
  tf2_ros::Buffer buffer;
  const tf2_ros::TransformListener listener(buffer);
  for (const char* frame : {"spindle", "tool_tip", "table", "dynamometer", "hammer"}) {
    EXPECT_TRUE(waitFor([&] { return buffer.canTransform("machine", frame, ros::Time(0)); }, TIMEOUT))
        << frame;
  }
}

TEST(Pipeline, PredictionWithoutChartReturnsNoChart) {
  ros::NodeHandle nh("smartmill");
  smartmill_msgs::PredictStability service;
  service.request.spindle_speed = 1000.0;
  service.request.axial_depth = 1e-3;
  ASSERT_TRUE(ros::service::waitForService(smartmill::names::absolute(smartmill::names::PREDICT_STABILITY),
                                           static_cast<int>(1e3 * TIMEOUT)));
  ASSERT_TRUE(
      nh.serviceClient<smartmill_msgs::PredictStability>(smartmill::names::PREDICT_STABILITY).call(service));
  EXPECT_EQ(service.response.code, smartmill_msgs::PredictStability::Response::NO_CHART);
}

TEST(ShippedFiles, SessionParametersAndModelsAreRead) {
  const std::string package = ros::package::getPath("smartmill_launch");
  smartmill::session::SessionParameters parameters;
  // The model is set by the launch file, all other parameters by the YAML file.
  try {
    parameters = smartmill::ParameterReader::fromFile(package + "/config/session.yaml")
                     .readAll<smartmill::session::SessionParameters>();
    FAIL() << "a session without a model was accepted";
  } catch (const smartmill::Error& error) {
    EXPECT_EQ(std::string(error.what()).rfind("model: ", 0), 0u) << error.what();
  }
  const smartmill::MachineModel machine = smartmill::readMachineModel(package + "/models/mill.yaml");
  const smartmill::MachineModel twin = smartmill::readMachineModel(package + "/models/mill_twin.yaml");
  // The nominal model contains nothing that the session identifies.
  EXPECT_FALSE(machine.cutting);
  EXPECT_TRUE(machine.tool_tip.x.modes.empty() && machine.tool_tip.y.modes.empty());
  EXPECT_TRUE(twin.cutting);
  EXPECT_NO_THROW(smartmill::session::SessionPlan(machine, smartmill::session::PlanParameters()));
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "pipeline_test");
  ros::NodeHandle keep_ros_running;
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
