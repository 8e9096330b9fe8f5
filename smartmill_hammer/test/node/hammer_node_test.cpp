// Interfaces of hammer_node: one measurement on the closed-form machine, the replay of its bag, a cancel.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/Frf.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <smartmill_msgs/SpindleHealth.h>

#include "../closed_form_machine.h"
#include "recordings/bag_replay.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"

namespace smartmill::hammer {
namespace {

using Client = actionlib::SimpleActionClient<smartmill_msgs::MeasureFrfAction>;

const ros::Duration PATIENCE(1000.0);  // of the machine's time, on a busy computer

class HammerNode : public testing::Test {
 protected:
  HammerNode() : client(names::MEASURE_TOOL_FRF, true), spinner(2) {
    spinner.start();
    ros::Time::waitForValid();
  }

  smartmill_msgs::MeasureFrfGoal goal() const {
    smartmill_msgs::MeasureFrfGoal g;
    g.header.stamp = ros::Time::now() + ros::Duration(4.0);  // in order on a busy computer too
    g.tool = "mill";
    g.point = "tool_tip";
    g.direction = "x";
    g.hits = 3;
    g.modes = 2;
    g.stickout = 51e-3;
    g.teeth = 4;
    return g;
  }

  static ros::Time stampOf(const smartmill_msgs::MeasureFrfActionGoal&) { return ros::TIME_MAX; }
  template <class Message>
  static ros::Time stampOf(const Message& m) {
    return m.header.stamp;
  }

  template <class Message>
  void record(const std::string& topic) {
    boost::function<void(const boost::shared_ptr<const Message>&)> write =
        [this, topic](const boost::shared_ptr<const Message>& m) {
          const std::lock_guard<std::mutex> lock(mutex);
          ++recorded;
          newest[topic] = stampOf(*m);
          if (bag.isOpen()) bag.write("/smartmill/" + topic, ros::Time::now(), *m);
        };
    recorders.push_back(nh.subscribe<Message>(topic, 0, write));
  }

  /// Whether every recorder is connected, and has been for a while.
  bool recording() {
    const std::lock_guard<std::mutex> lock(mutex);
    return recorded > 200 && std::all_of(recorders.begin(), recorders.end(),
                                         [](const ros::Subscriber& s) { return s.getNumPublishers() > 0; });
  }

  /// Whether all messages up to a time have been recorded.
  bool recordedUpTo(const ros::Time& time) {
    const std::lock_guard<std::mutex> lock(mutex);
    return std::all_of(newest.begin(), newest.end(), [&](const auto& entry) { return entry.second > time; });
  }

  ros::NodeHandle nh;
  Client client;
  ros::AsyncSpinner spinner;
  std::mutex mutex;
  rosbag::Bag bag;
  int recorded = 0;                         // messages
  std::map<std::string, ros::Time> newest;  // by topic
  std::vector<ros::Subscriber> recorders;
};

TEST_F(HammerNode, MeasuresRecordsAndReplaysToTheLastDigit) {
  ASSERT_TRUE(client.waitForServer(PATIENCE));
  const std::string folder = testing::TempDir();
  const std::string bag_file = folder + "smartmill_hammer_node_test.bag";
  bag.open(bag_file, rosbag::bagmode::Write);
  record<smartmill_msgs::SampleBlock>(names::HAMMER);
  record<smartmill_msgs::CncState>(names::CNC_STATE);
  record<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE);
  record<smartmill_msgs::MeasureFrfActionGoal>(names::goals(names::MEASURE_TOOL_FRF));
  ASSERT_TRUE(eventually([&] { return recording(); }));
  client.sendGoal(goal());
  ASSERT_TRUE(client.waitForResult(PATIENCE));
  const auto result = client.getResult();
  ASSERT_TRUE(result);
  ASSERT_EQ(result->code, smartmill_msgs::MeasureFrfResult::OK) << result->message;
  EXPECT_EQ(client.getState(), actionlib::SimpleClientGoalState::SUCCEEDED);
  const ClosedFormMachine truth(42);
  ASSERT_EQ(result->modes.modes.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_NEAR(result->modes.modes[k].frequency, truth.tip[0].modes[k].frequency,
                0.005 * truth.tip[0].modes[k].frequency);
    EXPECT_NEAR(result->modes.modes[k].gain, truth.tip[0].modes[k].gain, 0.05 * truth.tip[0].modes[k].gain);
  }

  // Late subscribers receive it too.
  smartmill_msgs::FrfConstPtr frf;
  smartmill_msgs::ModalModelConstPtr modes;
  frf = ros::topic::waitForMessage<smartmill_msgs::Frf>(names::TOOL_FRF, nh, PATIENCE);
  modes = ros::topic::waitForMessage<smartmill_msgs::ModalModel>(names::TOOL_MODES, nh, PATIENCE);
  ASSERT_TRUE(frf && modes);
  EXPECT_EQ(frf->real, result->frf.real);
  EXPECT_EQ(modes->direction, "x");

  // A second measurement is reported against the first.
  smartmill_msgs::SpindleHealthConstPtr health;
  const boost::function<void(const smartmill_msgs::SpindleHealthConstPtr&)> take = [&](const auto& m) {
    const std::lock_guard<std::mutex> lock(mutex);
    health = m;
  };
  const auto subscriber = nh.subscribe<smartmill_msgs::SpindleHealth>(names::SPINDLE_HEALTH, 10, take);
  ASSERT_TRUE(eventually([&] { return subscriber.getNumPublishers() > 0; }));
  ASSERT_TRUE(eventually([&, now = ros::Time::now()] { return recordedUpTo(now); }));
  {
    const std::lock_guard<std::mutex> lock(mutex);
    bag.close();
  }
  client.sendGoal(goal());
  ASSERT_TRUE(client.waitForResult(PATIENCE));
  ASSERT_EQ(client.getResult()->code, smartmill_msgs::MeasureFrfResult::OK) << client.getResult()->message;
  ASSERT_TRUE(eventually([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return health != nullptr;
  }));
  EXPECT_EQ(health->measured, "mill tool_tip x");
  EXPECT_EQ(health->header.stamp, client.getResult()->modes.header.stamp);
  ASSERT_EQ(health->changes.size(), 6u);
  EXPECT_EQ(health->changes[0].first, modes->modes[0].frequency);
  EXPECT_EQ(health->changes[0].now, client.getResult()->modes.modes[0].frequency);
  for (const auto& change : health->changes) EXPECT_FALSE(change.drifted) << change.quantity;

  // The replayed bag gives the same digits.
  std::string model;
  ASSERT_TRUE(nh.getParam("hammer/model", model));
  const std::vector<MeasureFrfResult> results = replayBag(bag_file, model, {});
  ASSERT_EQ(results.size(), 1u);
  const MeasureFrfResult& again = results[0];
  ASSERT_EQ(again.code, FrfCode::ok) << again.message;
  EXPECT_EQ(again.sensitivity, result->sensitivity);
  ASSERT_EQ(again.frf.frf.size(), result->frf.real.size());
  for (std::size_t k = 0; k < again.frf.frf.size(); ++k) {
    ASSERT_EQ(again.frf.frf.value[k].real(), result->frf.real[k]);
    ASSERT_EQ(again.frf.frf.value[k].imag(), result->frf.imag[k]);
  }
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(again.modes.model.modes[k].frequency, result->modes.modes[k].frequency);
    EXPECT_EQ(again.modes.model.modes[k].gain, result->modes.modes[k].gain);
    EXPECT_EQ(again.modes.model.modes[k].gain_std, result->modes.modes[k].gain_std);
  }
  std::filesystem::remove(bag_file);
}

TEST_F(HammerNode, CancelEndsIt) {
  ASSERT_TRUE(client.waitForServer(PATIENCE));
  std::atomic<bool> begun{false};
  client.sendGoal(goal(), {}, {}, [&](const smartmill_msgs::MeasureFrfFeedbackConstPtr&) { begun = true; });
  ASSERT_TRUE(eventually([&] { return begun.load(); }));
  client.cancelGoal();
  ASSERT_TRUE(client.waitForResult(PATIENCE));
  EXPECT_EQ(client.getState(), actionlib::SimpleClientGoalState::PREEMPTED);
  EXPECT_EQ(client.getResult()->code, smartmill_msgs::MeasureFrfResult::CANCELLED)
      << client.getResult()->message;
}

TEST_F(HammerNode, RefusesABadGoalInOneLine) {
  ASSERT_TRUE(client.waitForServer(PATIENCE));
  auto bad = goal();
  bad.direction = "z";
  client.sendGoal(bad);
  ASSERT_TRUE(client.waitForResult(PATIENCE));
  EXPECT_EQ(client.getResult()->code, smartmill_msgs::MeasureFrfResult::BAD_GOAL);
  EXPECT_NE(client.getResult()->message.find("'z'"), std::string::npos) << client.getResult()->message;
}

}  // namespace
}  // namespace smartmill::hammer

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "hammer_node_test");
  return RUN_ALL_TESTS();
}
