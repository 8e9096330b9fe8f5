// The monitor with a machine equal to its model, and with one that has a hidden runout. Checks use the stamps
// of the data; only timeouts use wall time.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/DiscrepancyState.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/data/dataset.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/follower.h"
#include "smartmill_sim/effects/effect_set.h"
#include "smartmill_sim/twin/twin.h"

namespace smartmill::discrepancy {
namespace {

constexpr double RATE = 25600.0, DURATION = 1.0, FEED_PER_TOOTH = 1e-4;
constexpr std::size_t BLOCK = 256;

class MonitorNodeTest : public testing::Test {
 protected:
  MonitorNodeTest() {
    ros::NodeHandle private_nh("~");
    private_nh.getParam("folder", folder_);
    std::string model;
    private_nh.getParam("model", model);
    model_ = readMachineModel(model);
    conditions_ = nh_.advertise<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION, 0);
    states_ = nh_.advertise<smartmill_msgs::CncState>(names::CNC_STATE, 0);
    angles_ = nh_.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 0);
    blocks_ = nh_.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 0);
    results_ = nh_.subscribe<smartmill_msgs::DiscrepancyState>(
        names::DISCREPANCY_STATE, 100,
        boost::function<void(const smartmill_msgs::DiscrepancyState&)>(
            [this](const auto& m) { gaps_.push_back(m); }));
    diagnostics_ = nh_.subscribe<diagnostic_msgs::DiagnosticArray>(
        "/diagnostics", 100,
        boost::function<void(const diagnostic_msgs::DiagnosticArray&)>([this](const auto& m) {
          for (const auto& s : m.status) {
            if (s.name.find("model fits") != std::string::npos) status_ = s;
          }
        }));
  }
  ~MonitorNodeTest() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  bool wait(const std::function<bool()>& reached) {
    for (int i = 0; i < 2400 && !reached(); ++i) {
      ros::spinOnce();
      ros::WallDuration(0.05).sleep();
    }
    return reached();
  }

  // A second of slot milling, one message per 10 ms and stream.
  void mill(const MachineModel& machine, const std::string& name, double begin, double rpm, double depth) {
    CuttingCondition condition;
    condition.stamp = begin;
    condition.kind = CuttingCondition::Kind::cut;
    condition.name = name;
    condition.tool = *machine.tool;
    condition.spindle_speed = units::radPerSecFromRpm(rpm);
    condition.engagement = Engagement{0.0, units::PI, depth, FEED_PER_TOOTH};
    condition.steady_to = {{0.2, 0.0, 0.0}};
    CampaignTest test;
    test.name = name;
    test.sample_rate = RATE;
    test.spindle_speed = condition.spindle_speed;
    test.engagement = condition.engagement;
    test.running_before = 0.4;
    sim::SimulationOptions options;
    options.seed = static_cast<std::uint64_t>(begin);
    options.substeps = 8;  // finer than the monitor's
    options.phase = 0.3;
    const Record record = sim::simulateTest(machine, test, DURATION, options);
    const auto &fx = record.column("fx"), &fy = record.column("fy"), &fz = record.column("fz");
    node_.publish(conditions_, toMsg(condition));
    node_.settle();  // messages of different topics are not ordered
    const double feed = FEED_PER_TOOTH * machine.tool->teeth * test.spindle_speed / units::TWO_PI;
    for (std::size_t k = 0; (k + 1) * BLOCK <= record.size(); ++k) {
      const double t = static_cast<double>(k * BLOCK) / RATE;
      CncState state;
      state.stamp = begin + t;
      state.axes = {"X", "Y", "Z"};
      state.position = {feed * t, 0.0, 0.0};
      state.distance_to_go = {0.0, 0.0, 0.0};
      state.spindle_speed = test.spindle_speed;
      node_.publish(states_, toMsg(state));
      SpindleAngle angle;
      angle.stamp = begin + t;
      angle.speed = test.spindle_speed;
      angle.angle = std::fmod(0.3 + test.spindle_speed * t, units::TWO_PI);
      node_.publish(angles_, toMsg(angle));
      SampleBlock block;
      block.stamp = begin + t;
      block.sample_rate = RATE;
      block.first_index = index_;
      index_ += BLOCK;
      block.channels = {"fx", "fy", "fz"};
      block.units = {"N", "N", "N"};
      for (std::size_t i = k * BLOCK; i < (k + 1) * BLOCK; ++i)
        block.samples.insert(block.samples.end(), {fx[i], fy[i], fz[i]});
      node_.publish(blocks_, toMsg(block));
    }
  }

  std::vector<smartmill_msgs::DiscrepancyState> gapsOf(const std::string& name) const {
    std::vector<smartmill_msgs::DiscrepancyState> result;
    std::copy_if(gaps_.begin(), gaps_.end(), std::back_inserter(result),
                 [&](const auto& g) { return g.condition == name; });
    return result;
  }

  ros::NodeHandle nh_;
  std::string folder_;
  MachineModel model_;
  ros::Publisher conditions_, states_, angles_, blocks_;
  ros::Subscriber results_, diagnostics_;
  std::vector<smartmill_msgs::DiscrepancyState> gaps_;
  diagnostic_msgs::DiagnosticStatus status_;
  std::uint64_t index_ = 0;
  Followers node_{{names::absolute("monitor")}};
};

TEST_F(MonitorNodeTest, WarnsOfAHiddenEffectOnly) {
  node_.begin();
  for (const ros::Publisher& publisher : {conditions_, states_, angles_, blocks_}) node_.expect(publisher);
  node_.expect(results_);
  node_.expect(diagnostics_);

  // 0.15 s of settling leave two segments of 0.3 s of a second.
  mill(model_, "healthy", 1000.0, 4000.0, 1e-3);
  ASSERT_TRUE(wait([&] { return gapsOf("healthy").size() == 2 && status_.message == "model fits"; }))
      << gaps_.size() << status_.message;
  for (const auto& g : gapsOf("healthy")) {
    EXPECT_TRUE(g.model_fits);
    ASSERT_EQ(g.gap.size(), 3U);
    // Deviation 0.008 of 7680 samples, and the difference between two accurate processes.
    for (const double gap : g.gap) EXPECT_NEAR(gap, 1.0, 0.1);
  }
  EXPECT_EQ(status_.level, diagnostic_msgs::DiagnosticStatus::OK);
  EXPECT_FALSE(std::filesystem::exists(folder_));

  MachineModel hiding = model_;
  hiding.effects = {effectEntry("runout", {{"offset_um", 12.0}, {"angle_deg", 40.0}})};
  mill(hiding, "hiding", 1010.0, 4000.0, 1e-3);
  ASSERT_TRUE(wait([&] {
    return gapsOf("hiding").size() == 2 && status_.level == diagnostic_msgs::DiagnosticStatus::WARN;
  })) << gaps_.size()
      << status_.message;
  for (const auto& g : gapsOf("hiding")) EXPECT_FALSE(g.model_fits);
  EXPECT_EQ(status_.message, "model does not fit in hiding: run explain");

  // Stamps independent of wall time; chatter is no misfit.
  mill(model_, "chattering", 1020.0, 9000.0, 6e-3);
  ASSERT_TRUE(wait([&] { return status_.message.find("not compared: chattering chatters") == 0; }))
      << status_.message;
  for (const auto& g : gapsOf("chattering")) {
    EXPECT_TRUE(g.model_fits);
    EXPECT_TRUE(g.gap.empty());
  }

  const Dataset data = loadDataset(readCampaign(folder_), readMachineModel(folder_ + "/model.yaml"));
  ASSERT_EQ(data.tests.size(), 2U);
  for (const TestData& t : data.tests) {
    EXPECT_EQ(t.test.name.rfind("hiding", 0), 0U) << t.test.name;
    EXPECT_NEAR(t.test.spindle_speed, units::radPerSecFromRpm(4000.0), 0.01);
    EXPECT_GE(*t.test.running_before, 0.14);
    EXPECT_EQ(t.record.size(), 7680U);
  }
}

}  // namespace
}  // namespace smartmill::discrepancy

int main(int argc, char** argv) {
  ros::init(argc, argv, "monitor_node_test");
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
