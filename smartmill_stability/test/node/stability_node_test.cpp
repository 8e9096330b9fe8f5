#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <smartmill_msgs/ChatterAdvice.h>
#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/PredictStability.h>
#include <smartmill_msgs/StabilityChart.h>

#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/follower.h"
#include "smartmill_stability_testing/benchmark.h"
#include "smartmill_stability_testing/cutting_scene.h"

namespace smartmill::stability {
namespace {

using smartmill_msgs::PredictStability;

const ros::Duration TIMEOUT(120.0);  // sufficient on a busy computer

class StabilityNode : public ::testing::Test {
 protected:
  StabilityNode() : spinner_(1) { spinner_.start(); }

  PredictStability::Response predict(double rpm, double depth) {
    PredictStability call;
    call.request.spindle_speed = units::radPerSecFromRpm(rpm);
    call.request.axial_depth = depth;
    auto client = nh_.serviceClient<PredictStability>(names::PREDICT_STABILITY);
    EXPECT_TRUE(client.waitForExistence(TIMEOUT));
    EXPECT_TRUE(client.call(call));
    return call.response;
  }

  template <typename Message>
  ros::Publisher publisher(const char* topic) {
    ros::Publisher p = nh_.advertise<Message>(topic, 0);
    node_.begin();
    node_.expect(p);
    return p;
  }

  ros::NodeHandle nh_;
  ros::AsyncSpinner spinner_;
  Followers node_{{names::absolute("stability")}};
};

TEST_F(StabilityNode, publishesTheChartAndPredictsStability) {
  EXPECT_EQ(predict(10000.0, 0.05e-3).code, PredictStability::Response::NO_CHART);
  EXPECT_NE(predict(10000.0, 0.05e-3).message.find("FRF in x, FRF in y, tangential"), std::string::npos);

  const auto frfs = publisher<smartmill_msgs::Frf>(names::TOOL_FRF);
  const auto sets = publisher<smartmill_msgs::CuttingCoefficients>(names::COEFFICIENTS);
  frfs.publish(toMsg(frf("x", 1.0)));
  frfs.publish(toMsg(frf("y", 1.0)));
  sets.publish(toMsg(coefficients()));

  // Latched: a late subscriber receives it.
  const auto chart =
      ros::topic::waitForMessage<smartmill_msgs::StabilityChart>(names::STABILITY_CHART, nh_, TIMEOUT);
  ASSERT_TRUE(chart);
  EXPECT_EQ(chart->tool, "end_mill");
  EXPECT_EQ(chart->material, "aluminium");
  EXPECT_EQ(chart->spindle_speed.size(), 300u);
  EXPECT_EQ(chart->depth_limit.size(), 300u);
  EXPECT_EQ(toSec(chart->header.stamp), 20.0);
  EXPECT_FALSE(chart->recommended.empty());

  // Independent zero-order table, printed to 0.2 %; linear interpolation between lines of 1 Hz.
  const auto below = predict(10000.0, 0.07e-3), above = predict(10000.0, 0.08e-3);
  EXPECT_EQ(below.code, PredictStability::Response::OK);
  EXPECT_NEAR(below.point.depth_limit, 0.0737e-3, 0.01 * 0.0737e-3);
  EXPECT_TRUE(below.stable);
  EXPECT_FALSE(above.stable);
  EXPECT_EQ(predict(-1.0, 0.07e-3).code, PredictStability::Response::BAD_REQUEST);
}

TEST_F(StabilityNode, detectsChatterInAReplayedForce) {
  std::vector<smartmill_msgs::ChatterState> states;
  const ros::Subscriber subscriber = nh_.subscribe<smartmill_msgs::ChatterState>(
      names::CHATTER_STATE, 0,
      boost::function<void(const smartmill_msgs::ChatterState::ConstPtr&)>(
          [&](const smartmill_msgs::ChatterState::ConstPtr& state) { states.push_back(*state); }));
  const auto conditions = publisher<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION);
  const auto cnc = publisher<smartmill_msgs::CncState>(names::CNC_STATE);
  const auto angles = publisher<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE);
  const auto forces = publisher<smartmill_msgs::ForceBlock>(names::FORCE_COMPENSATED);

  struct Sink {
    const ros::Publisher &conditions, &cnc, &angles, &forces;
    Followers& node;
    void operator()(const CuttingCondition& c) const {
      node.publish(conditions, toMsg(c));
      node.settle();
    }
    void operator()(const CncState& s) const { node.publish(cnc, toMsg(s)); }
    void operator()(const SpindleAngle& a) const { node.publish(angles, toMsg(a)); }
    void operator()(const ForceBlock& b) const { node.publish(forces, toMsg(b, "machine")); }
  };
  node_.begin();
  node_.expect(subscriber);
  const Sink sink{conditions, cnc, angles, forces, node_};
  Scene scene;
  play(scene, sink, 100.0);
  scene.chatter = 150.0;
  play(scene, sink, 200.0);
  node_.end();
  // All messages have arrived; the pending callbacks are called here.
  spinner_.stop();
  ros::getGlobalCallbackQueue()->callAvailable();

  int quiet = 0, chatter = 0;
  for (const auto& state : states) {
    const double stamp = toSec(state.header.stamp);
    if (!state.valid) continue;
    EXPECT_EQ(state.condition, "cut_1");
    EXPECT_EQ(state.chatter, stamp > 200.0) << stamp;
    if (stamp > 200.0) {
      EXPECT_NEAR(state.frequency, scene.frequency, 0.5);
    }
    (stamp > 200.0 ? chatter : quiet) += 1;
  }
  EXPECT_GT(quiet, 10);
  EXPECT_GT(chatter, 10);
  // Two teeth: the highest speed below 2200 rad/s whose tooth passing frequency divides the chatter
  // frequency.
  const auto advice =
      ros::topic::waitForMessage<smartmill_msgs::ChatterAdvice>(names::CHATTER_ADVICE, nh_, TIMEOUT);
  ASSERT_TRUE(advice);
  EXPECT_EQ(advice->condition, "cut_1");
  EXPECT_GT(toSec(advice->header.stamp), 200.0);
  EXPECT_NEAR(advice->frequency, scene.frequency, 0.5);
  ASSERT_FALSE(advice->speeds.empty());
  EXPECT_NEAR(advice->speeds[0].spindle_speed, units::TWO_PI * scene.frequency / 4.0, 1.0);
  EXPECT_FALSE(advice->corrected);  // no modes were measured
}

}  // namespace
}  // namespace smartmill::stability

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "stability_node_test");
  return RUN_ALL_TESTS();
}
