// Topics, actions and services of the node, with a simulated machine in this test over the FOCAS protocol.
#include <actionlib/client/simple_action_client.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sys/wait.h>
#include <tf2_ros/transform_listener.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <thread>

#include "../test_machine.h"
#include "smartmill_core/names.h"
#include "smartmill_msgs/ArmMotion.h"
#include "smartmill_msgs/CncState.h"
#include "smartmill_msgs/CuttingCondition.h"
#include "smartmill_msgs/JogAction.h"
#include "smartmill_msgs/LoadSample.h"
#include "smartmill_msgs/MachineTemperature.h"
#include "smartmill_msgs/OrientSpindleAction.h"
#include "smartmill_msgs/RunProgramAction.h"
#include "smartmill_msgs/SetMacro.h"

namespace smartmill::cnc {
namespace {

using smartmill_msgs::CncState;
using smartmill_msgs::RunProgramResult;

constexpr double PATIENCE = 120.0;  // [s] for a busy computer

class CncNodeTest : public ::testing::Test {
 protected:
  CncNodeTest()
      : run_(names::RUN_PROGRAM, true), jog_(names::JOG, true), orient_(names::ORIENT_SPINDLE, true) {
    port_ = static_cast<std::uint16_t>(ros::NodeHandle("~").param("port", 18193));
    subscribers_.push_back(nh_.subscribe(names::CNC_STATE, 100, &CncNodeTest::onState, this));
    subscribers_.push_back(nh_.subscribe(names::CNC_LOAD, 100, &CncNodeTest::onLoad, this));
    subscribers_.push_back(nh_.subscribe(names::MACHINE_TEMPERATURE, 100, &CncNodeTest::onTemperature, this));
    subscribers_.push_back(nh_.subscribe(names::CUTTING_CONDITION, 100, &CncNodeTest::onCondition, this));
    subscribers_.push_back(nh_.subscribe("/diagnostics", 100, &CncNodeTest::onDiagnostics, this));
    clock_ = std::thread([this] {
      auto next_step = std::chrono::steady_clock::now();
      while (!done_) {
        machine_.advance(0.005);
        next_step += std::chrono::milliseconds(5);
        std::this_thread::sleep_until(next_step);
      }
    });
  }
  ~CncNodeTest() override {
    done_ = true;
    clock_.join();
  }

  void listen() {
    focas::ServerOptions options;
    options.port = port_;
    server_ = std::make_unique<focas::Server>(options, machine_.calls());
  }
  void onState(const CncState& state) {
    state_ = state;
    stamps_.push_back(state.header.stamp);
  }
  void onLoad(const smartmill_msgs::LoadSample& load) { load_ = load; }
  void onTemperature(const smartmill_msgs::MachineTemperature& temperature) { temperature_ = temperature; }
  void onCondition(const smartmill_msgs::CuttingCondition& condition) { conditions_.push_back(condition); }
  void onDiagnostics(const diagnostic_msgs::DiagnosticArray& array) {
    for (const diagnostic_msgs::DiagnosticStatus& status : array.status) {
      diagnostic_ = status;
    }
  }
  bool spinUntil(const std::function<bool()>& condition) {
    const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(PATIENCE);
    while (!condition()) {
      if (ros::WallTime::now() > deadline || !ros::ok()) {
        return false;
      }
      ros::spinOnce();
      ros::WallDuration(0.002).sleep();
    }
    return true;
  }
  std::uint8_t arm(bool on) {
    smartmill_msgs::ArmMotion service;
    service.request.arm = on;
    EXPECT_TRUE(ros::service::call(names::ARM_MOTION, service));
    return service.response.code;
  }
  /// @return the result of a program. @param then called once after the goal is sent.
  RunProgramResult program(const std::string& text, const std::function<void()>& then = {},
                           const smartmill_msgs::CuttingCondition& condition = {}) {
    smartmill_msgs::RunProgramGoal goal;
    goal.header.stamp = ros::Time::now();
    goal.name = "test";
    goal.program = text;
    goal.condition = condition;
    run_.sendGoal(goal);
    if (then) {
      then();
    }
    EXPECT_TRUE(run_.waitForResult(ros::Duration(PATIENCE)));
    return run_.getResult() ? *run_.getResult() : RunProgramResult();
  }
  void connectAndArm() {
    listen();
    ASSERT_TRUE(spinUntil([&] { return state_.connected != 0; }));
    ASSERT_EQ(arm(true), smartmill_msgs::ArmMotion::Response::OK);
    ASSERT_TRUE(run_.waitForServer(ros::Duration(PATIENCE)));
  }

  ros::NodeHandle nh_;
  std::uint16_t port_;
  TestMachine machine_;
  std::unique_ptr<focas::Server> server_;
  std::atomic<bool> done_{false};
  std::thread clock_;
  std::vector<ros::Subscriber> subscribers_;
  actionlib::SimpleActionClient<smartmill_msgs::RunProgramAction> run_;
  actionlib::SimpleActionClient<smartmill_msgs::JogAction> jog_;
  actionlib::SimpleActionClient<smartmill_msgs::OrientSpindleAction> orient_;
  CncState state_;
  std::vector<ros::Time> stamps_;  // of the states
  smartmill_msgs::LoadSample load_;
  smartmill_msgs::MachineTemperature temperature_;
  std::vector<smartmill_msgs::CuttingCondition> conditions_;
  diagnostic_msgs::DiagnosticStatus diagnostic_;
};

TEST_F(CncNodeTest, ClosedPortIsReportedAndRetried) {
  ASSERT_TRUE(spinUntil(
      [&] { return !stamps_.empty() && diagnostic_.level == diagnostic_msgs::DiagnosticStatus::ERROR; }));
  EXPECT_FALSE(state_.connected);
  EXPECT_NE(diagnostic_.message.find(std::to_string(port_)), std::string::npos) << diagnostic_.message;
  EXPECT_EQ(arm(true), smartmill_msgs::ArmMotion::Response::NOT_CONNECTED);
  ASSERT_TRUE(run_.waitForServer(ros::Duration(PATIENCE)));
  EXPECT_EQ(program("G0 X1\n").code, RunProgramResult::NOT_CONNECTED);
  listen();
  EXPECT_TRUE(spinUntil(
      [&] { return state_.connected && diagnostic_.level == diagnostic_msgs::DiagnosticStatus::OK; }));
}

TEST_F(CncNodeTest, StateLoadMacroAndTransform) {
  machine_.change([](TestMachine& m) {
    m.position = {{10.0, -20.0, 30.0}};
    m.speed = 3000.0;
    m.temperatures = {{403, focas::NumberedType::byte, {52.0}, false, 0}};
  });
  listen();
  ASSERT_TRUE(
      spinUntil([&] { return state_.connected && !load_.axes.empty() && load_.spindle_speed > 0.0; }));
  EXPECT_EQ(state_.mode, CncState::MODE_DNC);
  ASSERT_EQ(state_.position.size(), 3u);
  EXPECT_DOUBLE_EQ(state_.position[1], -0.020);
  EXPECT_NEAR(load_.spindle_load, 0.1234, 1e-12);
  EXPECT_NEAR(load_.spindle_speed, 314.159, 1e-3);
  ASSERT_TRUE(spinUntil([&] { return temperature_.axes.size() == 3; }));
  EXPECT_NEAR(temperature_.spindle_motor, 325.15, 1e-9);
  EXPECT_TRUE(std::isnan(temperature_.axis_motor[0]));  // number 308 is absent
  smartmill_msgs::SetMacro macro;
  macro.request.number = 500;
  macro.request.value = 2.5;
  ASSERT_TRUE(ros::service::call(names::SET_MACRO, macro));
  EXPECT_EQ(macro.response.code, smartmill_msgs::SetMacro::Response::OK);
  EXPECT_EQ(machine_.get(machine_.macros)[500], 2.5);
  tf2_ros::Buffer buffer;
  tf2_ros::TransformListener listener(buffer);
  ASSERT_TRUE(spinUntil([&] { return buffer.canTransform("machine", "spindle", ros::Time(0)); }));
  EXPECT_NEAR(buffer.lookupTransform("machine", "spindle", ros::Time(0)).transform.translation.z, 0.030,
              1e-9);
  // 50 Hz by the median period of two seconds: a busy computer delays some messages, a wrong rate all.
  // Retried, since a very busy computer may need several attempts.
  const auto medianPeriod = [&] {
    std::vector<double> periods;
    for (std::size_t i = stamps_.size() - 100; i < stamps_.size(); ++i)
      periods.push_back((stamps_[i] - stamps_[i - 1]).toSec());
    std::sort(periods.begin(), periods.end());
    return periods[periods.size() / 2];
  };
  stamps_.clear();
  EXPECT_TRUE(spinUntil([&] { return stamps_.size() > 100 && medianPeriod() < 0.03; }));
}

TEST_F(CncNodeTest, MotionsAndConditions) {
  connectAndArm();
  smartmill_msgs::CuttingCondition condition;
  condition.kind = smartmill_msgs::CuttingCondition::AIR;
  condition.name = "air_3000";
  condition.spindle_speed = 314.159;
  const RunProgramResult result = program("S3000 M3\nG1 X20 F6000\nM5\nM30\n", {}, condition);
  EXPECT_EQ(result.code, RunProgramResult::OK) << result.message;
  // The condition of the program is published, then NONE.
  EXPECT_TRUE(spinUntil([&] {
    const auto found = std::find_if(conditions_.begin(), conditions_.end(),
                                    [](const auto& c) { return c.name == "air_3000"; });
    return conditions_.end() - found >= 2 && found[1].kind == smartmill_msgs::CuttingCondition::NONE;
  }));
  smartmill_msgs::JogGoal jog;
  jog.axis = "z";
  jog.distance = -0.005;
  jog.feed = 0.05;
  EXPECT_TRUE(jog_.waitForServer(ros::Duration(PATIENCE)));
  jog_.sendGoal(jog);
  ASSERT_TRUE(jog_.waitForResult(ros::Duration(PATIENCE)));
  EXPECT_EQ(jog_.getResult()->code, RunProgramResult::OK) << jog_.getResult()->message;
  EXPECT_NEAR(machine_.machinePosition()[2], -5.0, 1e-9);
  smartmill_msgs::OrientSpindleGoal orient;
  orient.angle = 3.14159265358979;
  EXPECT_TRUE(orient_.waitForServer(ros::Duration(PATIENCE)));
  orient_.sendGoal(orient);
  ASSERT_TRUE(orient_.waitForResult(ros::Duration(PATIENCE)));
  EXPECT_EQ(orient_.getResult()->code, RunProgramResult::OK) << orient_.getResult()->message;
  EXPECT_EQ(machine_.get(machine_.macros)[1133], 2048.0);
  EXPECT_EQ(program("G0 X500\n").code, RunProgramResult::LIMIT);
  EXPECT_EQ(program("G3 X500\n").code, RunProgramResult::BAD_GOAL);
  EXPECT_EQ(arm(false), smartmill_msgs::ArmMotion::Response::OK);
  ASSERT_TRUE(spinUntil([&] { return !state_.armed; }));
  EXPECT_EQ(program("G0 X0\n").code, RunProgramResult::NOT_ARMED);
}

TEST_F(CncNodeTest, BusyAndCancel) {
  connectAndArm();
  const RunProgramResult result = program("G91 G1 X100 F600\n", [&] {
    ASSERT_TRUE(spinUntil([&] { return state_.motion != 0; }));
    smartmill_msgs::JogGoal jog;
    jog.axis = "x";
    jog.distance = 0.001;
    EXPECT_TRUE(jog_.waitForServer(ros::Duration(PATIENCE)));
    jog_.sendGoal(jog);
    ASSERT_TRUE(jog_.waitForResult(ros::Duration(PATIENCE)));
    EXPECT_EQ(jog_.getResult()->code, RunProgramResult::BUSY);
    run_.cancelGoal();
  });
  EXPECT_EQ(result.code, RunProgramResult::CANCELLED) << result.message;
  EXPECT_EQ(run_.getState().state_, actionlib::SimpleClientGoalState::PREEMPTED);
  EXPECT_LT(machine_.machinePosition()[0], 90.0);
}

TEST_F(CncNodeTest, ArmingInTheWrongModeIsRefused) {
  machine_.change([](TestMachine& m) { m.state.aut = focas::AUT_MEM; });
  listen();
  ASSERT_TRUE(spinUntil([&] { return state_.connected && state_.mode == CncState::MODE_MEM; }));
  EXPECT_EQ(arm(true), smartmill_msgs::ArmMotion::Response::WRONG_MODE);
  ASSERT_TRUE(run_.waitForServer(ros::Duration(PATIENCE)));
  EXPECT_EQ(program("G0 X1\n").code, RunProgramResult::WRONG_MODE);
}

TEST_F(CncNodeTest, MotionIsArmedForOneClientAndRecorded) {
  connectAndArm();
  smartmill_msgs::ArmMotion second;
  second.request.arm = true;
  second.request.client = "operator";
  ASSERT_TRUE(ros::service::call(names::ARM_MOTION, second));
  EXPECT_EQ(second.response.code, smartmill_msgs::ArmMotion::Response::HELD);
  EXPECT_NE(second.response.message.find(ros::this_node::getName()), std::string::npos)
      << second.response.message;
  EXPECT_EQ(second.response.holder, ros::this_node::getName());
  EXPECT_GT(second.response.since.toSec(), 0.0);
  EXPECT_EQ(program("G91 G1 X1 F600\n").code, RunProgramResult::OK);
  EXPECT_EQ(arm(false), smartmill_msgs::ArmMotion::Response::OK);
  // Armed under another name, this node cannot move the machine.
  ASSERT_TRUE(ros::service::call(names::ARM_MOTION, second));
  EXPECT_EQ(second.response.code, smartmill_msgs::ArmMotion::Response::OK);
  const RunProgramResult refused = program("G91 G1 X1 F600\n");
  EXPECT_EQ(refused.code, RunProgramResult::NOT_ARMED);
  EXPECT_NE(refused.message.find("motion is armed by operator since "), std::string::npos) << refused.message;
  EXPECT_EQ(arm(false), smartmill_msgs::ArmMotion::Response::OK);
  // A client that has ended holds motion no longer: no node has this name.
  second.request.client = "/smartmill/absent";
  ASSERT_TRUE(ros::service::call(names::ARM_MOTION, second));
  EXPECT_EQ(second.response.code, smartmill_msgs::ArmMotion::Response::OK);
  ASSERT_TRUE(spinUntil([&] { return state_.armed != 0; }));
  EXPECT_TRUE(spinUntil([&] { return state_.armed == 0; }));

  std::ifstream log(ros::NodeHandle("~").param<std::string>("motion_log", ""));
  const std::string text(std::istreambuf_iterator<char>(log), {});
  for (const char* line : {"arm: motion is armed\n", "arm: motion is armed by ", "program test, 15 bytes\n",
                           "disarm: motion is disarmed\n", "program test, 15 bytes REFUSED: ",
                           "/smartmill/absent  motion is disarmed: the client has ended\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << " in\n" << text;
}

TEST_F(CncNodeTest, ControllerLostDuringAProgram) {
  connectAndArm();
  const RunProgramResult result = program("G91 G1 X100 F600\n", [&] {
    ASSERT_TRUE(spinUntil([&] { return state_.motion != 0; }));
    server_.reset();
  });
  EXPECT_EQ(result.code, RunProgramResult::LOST);
  EXPECT_NE(result.message.find("lost"), std::string::npos);
  EXPECT_EQ(result.message.find('\n'), std::string::npos);
  ASSERT_TRUE(spinUntil([&] { return !state_.connected; }));
  EXPECT_FALSE(state_.armed);
}

TEST(CncNodeParameters, StringForNumberEndsTheNode) {
  // roslaunch converts 1e-2 to a string.
  ros::param::set("/smartmill/cnc_bad/settle_time", std::string("1e-2"));
  FILE* const pipe = ::popen("rosrun smartmill_cnc cnc_node __ns:=/smartmill __name:=cnc_bad 2>&1", "r");
  ASSERT_NE(pipe, nullptr);
  std::string output;
  char piece[256];
  while (std::fgets(piece, sizeof piece, pipe) != nullptr) {
    output += piece;
  }
  const int status = ::pclose(pipe);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1) << status;
  EXPECT_NE(output.find("/smartmill/cnc_bad/settle_time"), std::string::npos) << output;
  EXPECT_NE(output.find("1e-2"), std::string::npos) << output;
}

}  // namespace
}  // namespace smartmill::cnc

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "cnc_node_test");
  // Action clients have a callback thread of their own; the tests spin services and topics.
  return RUN_ALL_TESTS();
}
