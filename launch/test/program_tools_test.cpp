// A program with two tools from the memory of the simulated control: conditions with the tool of each cut,
// and the coefficients of each tool.

#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <actionlib/client/simple_action_client.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/IdentifyCoefficientsAction.h>
#include <smartmill_msgs/NodeHealth.h>
#include <smartmill_msgs/PanelKey.h>

#include "launched.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/names.h"
#include "waiting.h"

namespace smartmill {
namespace {

constexpr double TIMEOUT = 240.0;  // [s] time limit on a busy computer
using Condition = smartmill_msgs::CuttingCondition;
using State = smartmill_msgs::CncState;

bool wait(const std::function<bool()>& condition) {
  return testing::waitFor(condition, TIMEOUT);
}

void press(const std::string& key, const std::vector<double>& values, const std::string& text = "") {
  smartmill_msgs::PanelKey call;
  call.request.values = values;
  call.request.text = text;
  ASSERT_TRUE(ros::service::call(names::absolute("sim/panel/" + key), call)) << key;
  ASSERT_EQ(call.response.code, smartmill_msgs::PanelKey::Response::OK) << call.response.message;
}

TEST(ProgramWithTwoTools, GivesTheCoefficientsOfEach) {
  const std::string package = ros::package::getPath("smartmill_launch");
  const std::map<std::string, CuttingCoefficients> truth{
      {"end_mill T1", *readMachineModel(package + "/models/mill_twin.yaml").cutting},
      {"end_mill T2", *readMachineModel(package + "/test/second_tool_twin.yaml").cutting}};
  ros::NodeHandle nh("smartmill");
  std::vector<Condition> cuts;
  State state;
  bool warned = false;  // that the tool is not that of the stability chart
  std::set<std::string> missing{names::absolute("program") + names::absolute(names::CNC_STATE),
                                names::absolute("loadmeter") + names::absolute(names::CNC_STATE),
                                names::absolute("loadmeter") + names::absolute(names::CUTTING_CONDITION)};
  const ros::Subscriber on_condition = nh.subscribe<Condition>(
      names::CUTTING_CONDITION, 1000, boost::function<void(const Condition&)>([&](const Condition& c) {
        if (c.kind == Condition::CUT) cuts.push_back(c);
      }));
  const ros::Subscriber on_state = nh.subscribe<State>(
      names::CNC_STATE, 1000, boost::function<void(const State&)>([&](const State& m) { state = m; }));
  const ros::Subscriber on_diagnostics = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 1000,
      boost::function<void(const diagnostic_msgs::DiagnosticArray&)>([&](const auto& array) {
        for (const auto& status : array.status)
          warned =
              warned || status.message.find("'end_mill T2', is not that of the chart") != std::string::npos;
      }));
  const ros::Subscriber on_health = nh.subscribe<smartmill_msgs::NodeHealth>(
      names::NODE_HEALTH, 1000, boost::function<void(const smartmill_msgs::NodeHealth&)>([&](const auto& m) {
        for (const auto& input : m.inputs)
          if (input.publishers > 0) missing.erase(m.node + input.topic);
      }));
  ASSERT_TRUE(wait([&] { return state.connected && missing.empty(); }))
      << (missing.empty() ? "" : *missing.begin());

  press("program", {1010}, testing::contentOf(package + "/programs/two_tools.nc"));
  press("mode", {State::MODE_MEM});
  press("cycle_start", {});
  ASSERT_TRUE(wait([&] { return state.run == State::RUN_START; }));
  ASSERT_TRUE(wait([&] { return state.run != State::RUN_START || state.alarm; }));
  EXPECT_EQ(state.alarm_text, "");

  std::map<std::string, int> of_tool;
  int turning = 0;
  for (const Condition& cut : cuts) {
    ++of_tool[cut.tool];
    turning += std::isnan(cut.steady_to.x);
    EXPECT_EQ(cut.teeth, cut.tool == "end_mill T1" ? 4u : 3u) << cut.name;
    EXPECT_NEAR(cut.diameter, cut.tool == "end_mill T1" ? 0.01905 : 0.01, 1e-9) << cut.name;
  }
  EXPECT_EQ(of_tool["end_mill T1"], 3);
  EXPECT_GE(of_tool["end_mill T2"], 3);  // two slots and the ring of the pocket
  EXPECT_GE(turning, 1);
  EXPECT_TRUE(wait([&] { return warned; }));

  for (const auto& [tool, coefficients] : truth) {
    smartmill_msgs::IdentifyCoefficientsGoal goal;
    goal.header.stamp = ros::Time::now();
    goal.tool = tool;
    goal.material = "al7050";
    actionlib::SimpleActionClient<smartmill_msgs::IdentifyCoefficientsAction> client(
        names::absolute(names::IDENTIFY_COEFFICIENTS), false);
    ASSERT_TRUE(wait([&] { return client.isServerConnected(); }));
    client.sendGoal(goal);
    ASSERT_TRUE(wait([&] { return client.getState().isDone(); }));
    const auto result = client.getResult();
    ASSERT_EQ(result->code, smartmill_msgs::IdentifyCoefficientsResult::OK) << result->message;
    std::printf("%s: %s\n", tool.c_str(), result->message.c_str());
    EXPECT_NEAR(result->coefficients.ktc, coefficients.ktc, 0.03 * coefficients.ktc) << tool;
    EXPECT_NEAR(result->coefficients.kte, coefficients.kte, 0.1 * coefficients.kte) << tool;
  }
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  ros::init(argc, argv, "program_tools_test");
  const ros::NodeHandle keeps_alive;
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
