// The action `discover` on the simulated machine with its monitor: without armed motion, cancelled after a
// cut, and complete up to the installed model.

#include <atomic>
#include <filesystem>
#include <functional>
#include <string>

#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/ArmMotion.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/DiscoverAction.h>
#include <smartmill_msgs/InstallModel.h>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/names.h"

namespace smartmill {
namespace {

using Result = smartmill_msgs::DiscoverResult;
using Client = actionlib::SimpleActionClient<smartmill_msgs::DiscoverAction>;

constexpr double TIMEOUT = 300.0;  // [s] time limit on a busy computer

class Discover : public testing::Test {
 protected:
  Discover() : client_(names::absolute(names::DISCOVER), true) {
    state_ = nh_.subscribe<smartmill_msgs::CncState>(
        names::absolute(names::CNC_STATE), 10,
        boost::function<void(const smartmill_msgs::CncState&)>([this](const smartmill_msgs::CncState& m) {
          connected_ = m.connected;
          armed_ = m.armed;
        }));
    ros::NodeHandle("~").getParam("folder", folder_);
    EXPECT_TRUE(client_.waitForServer(ros::Duration(TIMEOUT)));
    EXPECT_TRUE(wait([this] { return connected_.load(); }));
  }

  static bool wait(const std::function<bool()>& condition) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(TIMEOUT);
    while (!condition() && ros::WallTime::now() < end) ros::WallDuration(0.02).sleep();
    return condition();
  }
  void arm() {
    smartmill_msgs::ArmMotion service;
    service.request.arm = 1;
    ASSERT_TRUE(ros::service::call(names::absolute(names::ARM_MOTION), service));
    ASSERT_EQ(service.response.code, 0) << service.response.message;
    ASSERT_TRUE(wait([this] { return armed_.load(); }));
  }
  void send() {
    smartmill_msgs::DiscoverGoal goal;
    goal.header.stamp = ros::Time::now();
    goal.most_tests = 1;
    goal.install = 1;
    cuts_ = 0;
    client_.sendGoal(goal, {}, {},
                     [this](const smartmill_msgs::DiscoverFeedbackConstPtr& f) { cuts_ = f->cuts_done; });
  }
  Result result() {
    EXPECT_TRUE(client_.waitForResult(ros::Duration(TIMEOUT)));
    return client_.getResult() ? *client_.getResult() : Result();
  }

  ros::NodeHandle nh_;
  Client client_;
  ros::Subscriber state_;
  std::atomic<bool> connected_{false}, armed_{false};
  std::atomic<unsigned> cuts_{0};
  std::string folder_;
};

TEST_F(Discover, doesNotMoveUnlessArmed) {
  send();
  const Result r = result();
  EXPECT_EQ(r.code, Result::NOT_ARMED);
  EXPECT_EQ(r.message, "motion is not armed (service cnc/arm_motion); nothing has moved");
}

TEST_F(Discover, isSafeAfterCancellation) {
  arm();
  send();
  ASSERT_TRUE(wait([this] { return cuts_ >= 1; }));
  // A second goal is rejected.
  Client other(names::absolute(names::DISCOVER), true);
  ASSERT_TRUE(other.waitForServer(ros::Duration(TIMEOUT)));
  EXPECT_EQ(other.sendGoalAndWait({}, ros::Duration(TIMEOUT)), actionlib::SimpleClientGoalState::REJECTED);
  EXPECT_EQ(other.getResult()->code, Result::BUSY);
  client_.cancelGoal();
  const Result r = result();
  EXPECT_EQ(r.code, Result::CANCELLED);
  EXPECT_EQ(r.message, "cancelled; records and explanations up to now are kept; motion is disarmed");
  EXPECT_TRUE(wait([this] { return !armed_; }));
}

TEST_F(Discover, identifiesTheHiddenEffect) {
  arm();
  send();
  const Result r = result();
  ASSERT_EQ(r.code, Result::OK) << r.message;
  EXPECT_EQ(r.verdict, "explained");
  ASSERT_EQ(r.effects.size(), 1u) << r.message;
  EXPECT_EQ(r.effects[0].rfind("gain_error: ", 0), 0u) << r.effects[0];
  EXPECT_GT(r.gap_before, 1.5);
  EXPECT_NEAR(r.gap_after, 1.0, 0.1);
  EXPECT_TRUE(std::filesystem::exists(r.report + "/report.html"));
  // The improved model is installed, the previous one is kept.
  EXPECT_EQ(r.model, folder_ + "/installed.yaml");
  const MachineModel now = readMachineModel(r.model), before = readMachineModel(folder_ + "/replaced_1.yaml");
  ASSERT_EQ(now.effects.size(), 1u);
  EXPECT_NEAR(now.effects[0].numbers.at("gain"), 1.12, 0.01);
  EXPECT_TRUE(before.effects.empty());
  // The monitor keeps its model if the next one is invalid.
  smartmill_msgs::InstallModel service;
  service.request.file = folder_ + "/none.yaml";
  ASSERT_TRUE(ros::service::call(names::absolute(names::INSTALL_MODEL), service));
  EXPECT_EQ(service.response.code, smartmill_msgs::InstallModel::Response::BAD_MODEL);
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  ros::init(argc, argv, "discover_test");
  ros::AsyncSpinner spinner(1);
  spinner.start();
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
