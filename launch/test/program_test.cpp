// A program on the simulated mill, sent without a condition: program_node states the cuts, and the load meter
// identifies the coefficients from them. A tooth that breaks in a further slot is reported.

#include <algorithm>
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
#include <smartmill_msgs/ArmMotion.h>
#include <smartmill_msgs/BreakTooth.h>
#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/CuttingCoefficients.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/IdentifyCoefficientsAction.h>
#include <smartmill_msgs/NewTool.h>
#include <smartmill_msgs/NodeHealth.h>
#include <smartmill_msgs/ProgramPath.h>
#include <smartmill_msgs/ProgramProgress.h>
#include <smartmill_msgs/RunProgramAction.h>
#include <smartmill_msgs/ToolCondition.h>

#include "launched.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"
#include "waiting.h"

namespace smartmill {
namespace {

constexpr double TIMEOUT = 240.0;  // [s] time limit on a busy computer
using Condition = smartmill_msgs::CuttingCondition;

bool wait(const std::function<bool()>& condition) {
  return testing::waitFor(condition, TIMEOUT);
}

template <class Action, class Result, class Goal>
Result resultOf(const std::string& name, const Goal& goal) {
  actionlib::SimpleActionClient<Action> client(names::absolute(name), false);
  EXPECT_TRUE(wait([&] { return client.isServerConnected(); })) << name;
  client.sendGoal(goal);
  EXPECT_TRUE(wait([&] { return client.getState().isDone(); })) << name;
  const auto result = client.getResult();
  return result ? *result : Result();
}

/// "796.1 +- 3.2" of a diagnostic.
struct Stated {
  double value = std::nan(""), std_dev = std::nan("");
  explicit Stated(const std::string& text) { std::sscanf(text.c_str(), "%lf +- %lf", &value, &std_dev); }
};

TEST(Program, OnePartGivesTheCoefficients) {
  const std::string package = ros::package::getPath("smartmill_launch");
  const MachineModel truth = readMachineModel(package + "/models/mill_twin.yaml");
  ros::NodeHandle nh("smartmill");
  std::vector<Condition> conditions;
  std::map<std::string, std::string> diagnostics;  // of the load meter and the program, by key
  smartmill_msgs::CncState state;
  smartmill_msgs::CuttingCoefficients published;
  const ros::Subscriber on_condition = nh.subscribe<Condition>(
      names::CUTTING_CONDITION, 1000,
      boost::function<void(const Condition&)>([&](const Condition& c) { conditions.push_back(c); }));
  const ros::Subscriber on_diagnostics = nh.subscribe<diagnostic_msgs::DiagnosticArray>(
      "/diagnostics", 1000,
      boost::function<void(const diagnostic_msgs::DiagnosticArray&)>([&](const auto& array) {
        for (const auto& status : array.status) {
          if (status.name.find("load meter") == std::string::npos &&
              status.name.find("NC program") == std::string::npos)
            continue;
          for (const auto& item : status.values) diagnostics[item.key] = item.value;
        }
      }));
  const ros::Subscriber on_state = nh.subscribe<smartmill_msgs::CncState>(
      names::CNC_STATE, 1000,
      boost::function<void(const smartmill_msgs::CncState&)>([&](const auto& m) { state = m; }));
  const ros::Subscriber on_coefficients = nh.subscribe<smartmill_msgs::CuttingCoefficients>(
      names::COEFFICIENTS, 10,
      boost::function<void(const smartmill_msgs::CuttingCoefficients&)>(
          [&](const auto& m) { published = m; }));
  std::map<std::string, int> judged, chattered;  // windows of the chatter detection, by cut
  const ros::Subscriber on_chatter = nh.subscribe<smartmill_msgs::ChatterState>(
      names::CHATTER_STATE, 1000,
      boost::function<void(const smartmill_msgs::ChatterState&)>([&](const smartmill_msgs::ChatterState& m) {
        if (m.valid) ++judged[m.condition];
        if (m.valid && m.chatter) ++chattered[m.condition];
      }));
  smartmill_msgs::ProgramPath path;
  const ros::Subscriber on_path = nh.subscribe<smartmill_msgs::ProgramPath>(
      names::PROGRAM_PATH, 10,
      boost::function<void(const smartmill_msgs::ProgramPath&)>([&](const auto& m) { path = m; }));
  std::map<std::uint32_t, double> peak;  // [N] largest force, by line
  const ros::Subscriber on_progress = nh.subscribe<smartmill_msgs::ProgramProgress>(
      names::PROGRAM_PROGRESS, 1000,
      boost::function<void(const smartmill_msgs::ProgramProgress&)>([&](const auto& m) {
        if (m.first_line == m.last_line) peak[m.last_line] = std::max(peak[m.last_line], m.peak_force);
      }));
  // A node that is connected later misses the first stretches in air.
  const std::map<std::string, std::set<std::string>> inputs{
      {"program", {names::CNC_STATE}}, {"loadmeter", {names::CNC_STATE, names::CUTTING_CONDITION}}};
  std::set<std::string> missing;
  for (const auto& [node, topics] : inputs)
    for (const std::string& topic : topics) missing.insert(names::absolute(node) + names::absolute(topic));
  double latency = 0.0;  // [s] the longest of all inputs
  const ros::Subscriber on_health = nh.subscribe<smartmill_msgs::NodeHealth>(
      names::NODE_HEALTH, 1000, boost::function<void(const smartmill_msgs::NodeHealth&)>([&](const auto& m) {
        for (const auto& input : m.inputs) {
          if (input.publishers > 0) missing.erase(m.node + input.topic);
          latency = std::max(latency, input.latency);
        }
      }));
  ASSERT_TRUE(wait([&] {
    return state.connected && diagnostics.count("parts begun") > 0 && missing.empty();
  })) << (missing.empty() ? "" : *missing.begin());
  EXPECT_LT(latency, 1000.0);  // of a stamp before the first message of the clock: since 1970

  smartmill_msgs::ArmMotion arm;
  arm.request.arm = 1;
  ASSERT_TRUE(ros::service::call(names::absolute(names::ARM_MOTION), arm));
  ASSERT_EQ(arm.response.code, 0) << arm.response.message;
  ASSERT_TRUE(wait([&] { return state.armed != 0; }));
  smartmill_msgs::RunProgramGoal program;
  program.header.stamp = ros::Time::now();
  program.name = "shoulder";
  program.program = testing::contentOf(package + "/programs/shoulder.nc");
  const auto run = resultOf<smartmill_msgs::RunProgramAction, smartmill_msgs::RunProgramResult>(
      names::RUN_PROGRAM, program);
  ASSERT_EQ(run.code, smartmill_msgs::RunProgramResult::OK) << run.message;

  // The seven passes, with the immersion that their step gives: cos = 1 - step / R.
  struct Pass {
    int line;
    double entry, exit, feed;  // [deg], [mm] per tooth
  };
  const double third = units::degFromRad(std::acos(1.0 - 6.35 / 9.525));
  const std::vector<Pass> passes{{13, 0, 180, 0.1},    {18, 0, 60, 0.2},    {21, 90, 180, 0.1},
                                 {24, 0, third, 0.05}, {27, 120, 180, 0.2}, {32, 0, 180, 0.15},
                                 {35, 90, 180, 0.1}};
  std::vector<Condition> cuts;
  std::size_t air = 0;
  for (const Condition& condition : conditions) {
    if (condition.kind == Condition::CUT) cuts.push_back(condition);
    if (condition.kind == Condition::AIR) ++air;
  }
  EXPECT_GE(air, 2u);  // two speeds
  ASSERT_EQ(cuts.size(), passes.size());
  for (std::size_t k = 0; k < passes.size(); ++k) {
    EXPECT_EQ(cuts[k].name, "shoulder.nc line " + std::to_string(passes[k].line));
    EXPECT_NEAR(units::degFromRad(cuts[k].entry_angle), passes[k].entry, 0.1) << cuts[k].name;
    EXPECT_NEAR(units::degFromRad(cuts[k].exit_angle), passes[k].exit, 0.1) << cuts[k].name;
    EXPECT_NEAR(cuts[k].axial_depth, 1e-3, 1e-8) << cuts[k].name;
    EXPECT_NEAR(cuts[k].feed_per_tooth / units::MM, passes[k].feed, 0.01 * passes[k].feed) << cuts[k].name;
    EXPECT_EQ(cuts[k].material, "al7050");
  }

  // Each cut is judged under the name of its line.
  for (const Condition& cut : cuts) {
    EXPECT_GT(judged[cut.name], 0) << cut.name;
    EXPECT_EQ(chattered[cut.name], 0) << cut.name;
  }

  // The running estimate of production, and an identification from the same cuts.
  ASSERT_TRUE(wait([&] { return diagnostics["cuts"] == std::to_string(passes.size()); }));
  const Stated ktc(diagnostics["production Ktc [N/mm2]"]), kte(diagnostics["production Kte [N/mm]"]);
  smartmill_msgs::IdentifyCoefficientsGoal identify;
  identify.header.stamp = ros::Time::now();
  identify.tool = "end_mill";
  identify.material = "al7050";
  const auto identified =
      resultOf<smartmill_msgs::IdentifyCoefficientsAction, smartmill_msgs::IdentifyCoefficientsResult>(
          names::IDENTIFY_COEFFICIENTS, identify);
  ASSERT_EQ(identified.code, smartmill_msgs::IdentifyCoefficientsResult::OK) << identified.message;
  ASSERT_TRUE(wait([&] { return published.test_count == passes.size(); }));
  const double true_ktc = truth.cutting->ktc, true_kte = truth.cutting->kte;
  std::printf("running estimate: Ktc %.1f +- %.1f N/mm2 (true %.1f), Kte %.2f +- %.2f N/mm (true %.2f)\n",
              ktc.value, ktc.std_dev, true_ktc / units::N_PER_MM2, kte.value, kte.std_dev,
              true_kte / units::N_PER_MM);
  std::printf("identified: %s\n", identified.message.c_str());
  EXPECT_NEAR(ktc.value * units::N_PER_MM2, true_ktc, 0.03 * true_ktc);
  EXPECT_NEAR(kte.value * units::N_PER_MM, true_kte, 0.05 * true_kte);
  EXPECT_NEAR(ktc.value * units::N_PER_MM2, true_ktc, 4.0 * ktc.std_dev * units::N_PER_MM2);
  EXPECT_NEAR(published.ktc, true_ktc, 0.03 * true_ktc);
  EXPECT_NEAR(published.kte, true_kte, 0.05 * true_kte);
  EXPECT_NEAR(published.ktc, true_ktc, 4.0 * published.ktc_std);
  EXPECT_NEAR(published.kte, true_kte, 4.0 * published.kte_std);

  // What these coefficients predict of each pass, and the force met there. The load meter gives no radial
  // coefficients (kr 0.3), and without a session the sensor rings: its force is no smaller.
  const auto predicted = [&](int line) {  // of the longest piece: the steady one
    double longest = 0.0, force = 0.0;
    for (std::size_t k = 0; k < path.line.size(); ++k) {
      const double length = path.place[k + 1] - path.place[k];
      if (path.line[k] != static_cast<std::uint32_t>(line) || !(path.peak_force[k] > 0.0) ||
          length <= longest)
        continue;
      longest = length;
      force = path.peak_force[k];
    }
    return force;
  };
  ASSERT_TRUE(wait([&] { return predicted(passes[0].line) > 0.0; }));
  for (const Pass& pass : passes) {
    const double expected = predicted(pass.line), met = peak[static_cast<std::uint32_t>(pass.line)];
    std::printf("line %d: predicted %.0f N, met %.0f N\n", pass.line, expected, met);
    const CuttingCoefficients known{published.ktc, 0.3 * published.ktc, 0.0,
                                    published.kte, published.kte,       0.0};
    const MechanisticForce force(*truth.tool, known,
                                 {units::radFromDeg(pass.entry), units::radFromDeg(pass.exit),
                                  1.0 * units::MM, pass.feed * units::MM});
    double largest = 0.0;
    for (int k = 0; k < 720; ++k) {
      const CuttingForce now = force.at(units::TWO_PI * k / 720.0);
      largest = std::max(largest, std::hypot(now.fx, now.fy));
    }
    EXPECT_NEAR(expected / largest, 1.0, 0.02) << pass.line;
    EXPECT_GT(met, 0.8 * expected) << pass.line;
  }
  EXPECT_EQ(diagnostics["parts begun"], "1");
  EXPECT_EQ(diagnostics["losses of the path"], "0");
}

/// Answer of the machine to the loss of a tooth; 0: a new tool.
smartmill_msgs::BreakTooth::Response breakTooth(std::uint32_t tooth) {
  smartmill_msgs::BreakTooth call;
  call.request.tooth = tooth;
  EXPECT_TRUE(ros::service::call(names::absolute("sim/break_tooth"), call));
  return call.response;
}

// Another slot of the same material, with the coefficients of the load meter: the wear of the sharp tool,
// then the loss of a tooth, which is no chatter.
TEST(Program, ALostToothIsReportedWithinTwoRevolutions) {
  constexpr double SPEED = 4000.0, FEED = 0.1 * units::MM, TO = -0.03, Z = -0.161;
  const MachineModel model =
      readMachineModel(ros::package::getPath("smartmill_launch") + "/models/mill_twin.yaml");
  ros::NodeHandle nh("smartmill");
  std::vector<smartmill_msgs::ToolCondition> reports;
  const ros::Subscriber on_tool = nh.subscribe<smartmill_msgs::ToolCondition>(
      names::TOOL_CONDITION, 1000,
      boost::function<void(const smartmill_msgs::ToolCondition&)>([&](const auto& m) {
        if (m.condition == "slot" || m.broken) reports.push_back(m);
      }));
  std::vector<smartmill_msgs::ChatterState> verdicts;
  const ros::Subscriber on_chatter = nh.subscribe<smartmill_msgs::ChatterState>(
      names::CHATTER_STATE, 1000,
      boost::function<void(const smartmill_msgs::ChatterState&)>([&](const auto& m) {
        if (m.valid && m.condition == "slot") verdicts.push_back(m);
      }));
  smartmill_msgs::ArmMotion arm;
  arm.request.arm = 1;
  ASSERT_TRUE(ros::service::call(names::absolute(names::ARM_MOTION), arm));
  ASSERT_EQ(arm.response.code, 0) << arm.response.message;

  smartmill_msgs::RunProgramGoal goal;
  goal.header.stamp = ros::Time::now();
  goal.name = "slot";
  goal.program = "G90 G0 Z-150.\nX-155. Y0.\nS4000 M3\nG4 X2.\nZ-161.\nG1 X-30. F1600.\nG0 Z-150.\nM30\n";
  CuttingCondition slot;
  slot.kind = CuttingCondition::Kind::cut;
  slot.name = "slot";
  slot.tool_name = "end_mill";
  slot.material = "al7050";
  slot.tool = *model.tool;
  slot.engagement = {0.0, units::PI, 1.0 * units::MM, FEED};
  slot.spindle_speed = units::radPerSecFromRpm(SPEED);
  slot.steady_from = {model.workpiece->low[0] + model.tool->diameter, 0.0, Z};
  slot.steady_to = {TO, 0.0, Z};
  goal.condition = toMsg(slot);
  actionlib::SimpleActionClient<smartmill_msgs::RunProgramAction> client(names::absolute(names::RUN_PROGRAM),
                                                                         false);
  ASSERT_TRUE(wait([&] { return client.isServerConnected(); }));
  client.sendGoal(goal);
  ASSERT_TRUE(wait([&] { return !reports.empty() || client.getState().isDone(); }));
  ASSERT_FALSE(reports.empty()) << client.getResult()->message;
  const smartmill_msgs::ToolCondition sharp = reports.front();
  std::printf("wear of the sharp tool %.1f +- %.1f %%\n", sharp.wear, sharp.wear_std);
  EXPECT_FALSE(sharp.broken);
  EXPECT_LT(std::abs(sharp.wear), 3.0 * sharp.wear_std);
  EXPECT_LT(sharp.wear_std, 5.0);

  EXPECT_EQ(breakTooth(5).code, smartmill_msgs::BreakTooth::Response::REFUSED);
  const smartmill_msgs::BreakTooth::Response broken = breakTooth(3);
  ASSERT_EQ(broken.code, smartmill_msgs::BreakTooth::Response::OK) << broken.message;
  ASSERT_TRUE(wait([&] { return reports.back().broken || client.getState().isDone(); }));
  const smartmill_msgs::ToolCondition report = reports.back();
  ASSERT_TRUE(report.broken);
  const double revolution = 60.0 / SPEED;  // [s]
  const double passed = (report.header.stamp - broken.stamp).toSec() / revolution,
               lost_at = (report.lost_at - broken.stamp).toSec() / revolution;
  std::printf(
      "tooth %u of %u reported %.2f revolutions after its loss, which is estimated at %.2f; %.0f +- %.0f "
      "%%\n",
      report.tooth, report.teeth, passed, lost_at, 100.0 * report.loss, 100.0 * report.loss_std);
  EXPECT_EQ(report.tooth, 3u);
  EXPECT_GT(passed, 0.0);
  EXPECT_LE(passed, 2.0);
  EXPECT_NEAR(lost_at, 0.0, 1.0);  // the tooth is missed when it comes to the cut again
  ASSERT_TRUE(wait([&] { return client.getState().isDone(); }));
  EXPECT_EQ(client.getResult()->code, smartmill_msgs::RunProgramResult::OK) << client.getResult()->message;
  int after = 0;
  for (const smartmill_msgs::ChatterState& verdict : verdicts) {
    // Windows that begin after the loss: 16 revolutions, and one more until the tooth is missed.
    if ((verdict.header.stamp - broken.stamp).toSec() < 17.0 * revolution) continue;
    ++after;
    EXPECT_FALSE(verdict.chatter) << verdict.frequency << " Hz";
  }
  EXPECT_GT(after, 5);

  EXPECT_EQ(breakTooth(0).code, smartmill_msgs::BreakTooth::Response::OK);
  smartmill_msgs::NewTool replaced;
  ASSERT_TRUE(ros::service::call(names::absolute(names::NEW_TOOL), replaced));
  EXPECT_NE(replaced.response.message.find("the loss of tooth 3"), std::string::npos)
      << replaced.response.message;
  bool whole = false;
  const ros::Subscriber on_new = nh.subscribe<smartmill_msgs::ToolCondition>(
      names::TOOL_CONDITION, 10,
      boost::function<void(const smartmill_msgs::ToolCondition&)>([&](const auto& m) { whole = !m.broken; }));
  EXPECT_TRUE(wait([&] { return whole; }));
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  ros::init(argc, argv, "program_test");
  ros::NodeHandle keep_ros_running;
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
