// Streams in, reports out: gaps, missing angle, wear of steady cuts.
#include "smartmill_program/tool/tool_monitor.h"

#include <gmock/gmock.h>

#include <cmath>
#include <vector>

#include "cutting_teeth.h"
#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"

namespace smartmill::program {
namespace {

using units::MM;
using units::PI;
using units::TWO_PI;

constexpr double SPEED = 50.0 * TWO_PI;  // [rad/s]
constexpr double RATE = 10000.0;         // [Hz]
constexpr int BLOCK = 100;
const CuttingCoefficients SHARP{796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3};

ToolGeometry tool() {
  ToolGeometry t;
  t.teeth = 4;
  t.diameter = 10.0 * MM;
  return t;
}

CuttingCondition cut(const std::string& name, double stamp, double feed) {
  CuttingCondition condition;
  condition.stamp = stamp;
  condition.kind = CuttingCondition::Kind::cut;
  condition.name = name;
  condition.tool_name = "mill";
  condition.material = "steel";
  condition.tool = tool();
  condition.engagement = {0.0, PI / 2.0, 2.0 * MM, feed};
  condition.spindle_speed = SPEED;
  condition.steady_from = {0.0, 0.0, 0.0};
  condition.steady_to = {0.0, 1.0, 0.0};  // along y
  return condition;
}

MachineModel model() {
  MachineModel m;
  m.tool = tool();
  return m;
}

struct Rig {
  std::vector<ToolReport> reports;
  ToolMonitor monitor{ToolMonitorParameters(), SharpTools({{0, model()}}), 0.05,
                      [this](const ToolReport& report) { reports.push_back(report); }};
  std::uint64_t index = 0;
  double transient_from = 1e9;  // [s]
  double feed = 0.01;           // [m/s] of the controller

  /// Its coefficients are identified.
  void knowTool(const std::string& name) {
    CoefficientSet set;
    set.tool = name;
    set.material = "steel";
    set.value = SHARP;
    monitor.tools().add(set);
  }

  /// @param force of a time and angle
  template <class Force>
  void run(double from, double to, const Force& force, bool with_angle = true) {
    for (double t = from; t < to - 1e-9; t += BLOCK / RATE) {
      ForceBlock block;
      block.stamp = t;
      block.sample_rate = RATE;
      block.first_index = index;
      block.status = t > transient_from ? ForceBlock::Status::transient : ForceBlock::Status::compensated;
      for (int i = 0; i < BLOCK; ++i) {
        const double time = t + i / RATE;
        const ForceSample sample = force(time, SPEED * time);
        block.force[0].push_back(sample.fx);
        block.force[1].push_back(sample.fy);
        block.force[2].push_back(0.0);
      }
      index += BLOCK;
      monitor.push(block);
      for (int k = 0; with_angle && k < 4; ++k) {
        const double time = t + k * BLOCK / RATE / 4;
        monitor.push(SpindleAngle{time, std::fmod(SPEED * time, TWO_PI), SPEED});
      }
      CncState state;
      state.stamp = t;
      state.connected = true;
      state.feed = feed;
      state.spindle_speed = SPEED;
      state.axes = {"X", "Y", "Z"};
      state.position = {0.0, 0.1, 0.0};
      monitor.push(state);
    }
  }
};

CuttingTeeth broken(double from) {
  CuttingTeeth teeth;
  teeth.missing = 3;
  teeth.missing_from = SPEED * from;
  return teeth;
}

TEST(ToolMonitor, ReportsALossWithoutACondition) {
  Rig rig;
  const CuttingTeeth teeth = broken(1.003);
  rig.run(0.0, 2.0, [&](double t, double a) { return teeth.at(t, a); });
  rig.monitor.flush();
  ASSERT_EQ(rig.reports.size(), 1u);
  EXPECT_TRUE(rig.reports[0].new_loss);
  EXPECT_EQ(rig.reports[0].loss->tooth, 3);
  EXPECT_LE(rig.reports[0].stamp, 1.003 + 2.0 * TWO_PI / SPEED);
  EXPECT_FALSE(rig.reports[0].wear);
}

TEST(ToolMonitor, ReportsNoLossAtFeedsOfTheSizeOfTheRunout) {
  Rig rig;
  rig.feed = 4 * SPEED / TWO_PI * 4e-6;
  const CuttingTeeth teeth = broken(1.003);
  rig.run(0.0, 2.0, [&](double t, double a) { return teeth.at(t, a); });
  rig.monitor.flush();
  EXPECT_TRUE(rig.reports.empty());
}

// As force/compensated: the blocks from the loss on are transients.
TEST(ToolMonitor, ReportsALossThatIsATransient) {
  Rig rig;
  rig.transient_from = 0.99;
  const CuttingTeeth teeth = broken(1.003);
  rig.run(0.0, 2.0, [&](double t, double a) { return teeth.at(t, a); });
  rig.monitor.flush();
  ASSERT_EQ(rig.reports.size(), 1u);
  EXPECT_EQ(rig.reports[0].loss->tooth, 3);
}

TEST(ToolMonitor, ANewToolHasAllItsTeeth) {
  Rig rig;
  const CuttingTeeth teeth = broken(1.003), whole;
  rig.run(0.0, 1.5, [&](double t, double a) { return teeth.at(t, a); });
  ASSERT_EQ(rig.reports.size(), 1u);
  rig.monitor.newTool(1.6);
  ASSERT_EQ(rig.reports.size(), 2u);
  EXPECT_FALSE(rig.reports[1].loss);
  EXPECT_FALSE(rig.monitor.loss());
  EXPECT_EQ(rig.reports[1].stamp, 1.6);
  rig.run(1.7, 2.5, [&](double t, double a) { return whole.at(t, a); });
  rig.monitor.flush();
  EXPECT_EQ(rig.reports.size(), 2u);
}

TEST(ToolMonitor, ReportsNothingWithoutAngleForceOrAtLostSamples) {
  const CuttingTeeth teeth = broken(1.003);
  const auto force = [&](double t, double a) { return teeth.at(t, a); };
  Rig without_angle;
  without_angle.run(0.0, 2.0, force, false);
  without_angle.monitor.flush();
  EXPECT_THAT(without_angle.reports, testing::IsEmpty());
  Rig zero;
  zero.run(0.0, 2.0, [](double t, double a) { return ForceSample{t, a, 0.0, 0.0}; });
  zero.monitor.flush();
  EXPECT_THAT(zero.reports, testing::IsEmpty());
  Rig lost;
  lost.run(0.0, 1.0, force);
  lost.index += 7;  // lost samples
  lost.run(1.0, 2.0, force);
  lost.monitor.flush();
  EXPECT_THAT(lost.reports, testing::IsEmpty());
  Rig missing;  // values that are not measured
  missing.run(0.0, 2.0, [&](double t, double a) {
    ForceSample sample = force(t, a);
    if (t > 0.99 && t < 1.02) sample.fx = NOT_A_NUMBER;
    return sample;
  });
  missing.monitor.flush();
  EXPECT_THAT(missing.reports, testing::IsEmpty());
}

TEST(ToolMonitor, ASampleBlockWithoutForcesIsRefusedInOneLine) {
  Rig rig;
  SampleBlock block;
  block.sample_rate = RATE;
  block.channels = {"fx", "fz"};
  block.samples = {1.0, 2.0};
  EXPECT_THAT([&] { rig.monitor.push(block); }, testing::ThrowsMessage<Error>(testing::HasSubstr("fy")));
}

/// Mean force in the machine for a feed along y: rotated by 90 degrees, from the closed form.
ForceSample meanForce(const CuttingCoefficients& k, const Engagement& engagement, double t, double a) {
  const CuttingForce mean = MechanisticForce(tool(), k, engagement).mean();
  return {t, a, -mean.fy, mean.fx};
}

TEST(ToolMonitor, WearOfTheEdgeFollowsFromCutsOfDifferentFeed) {
  Rig rig;
  rig.knowTool("mill");
  CuttingCoefficients worn = SHARP;
  worn.kte *= 1.5;
  worn.kre *= 1.5;
  double start = 0.0;
  for (const double feed : {0.05 * MM, 0.2 * MM}) {
    const CuttingCondition condition = cut(feed < 0.1 * MM ? "fine" : "coarse", start, feed);
    rig.monitor.push(condition);
    rig.run(start, start + 2.0,
            [&](double t, double a) { return meanForce(worn, condition.engagement, t, a); });
    start += 2.0;
  }
  CuttingCondition none;
  none.stamp = start;
  rig.monitor.push(none);
  rig.monitor.flush();
  ASSERT_GE(rig.reports.size(), 4u);
  const auto expected = [&](double feed) {
    const Engagement e{0.0, PI / 2.0, 2.0 * MM, feed};
    const CuttingForce a = MechanisticForce(tool(), worn, e).mean(),
                       b = MechanisticForce(tool(), SHARP, e).mean();
    return (a.fx * b.fx + a.fy * b.fy) / (b.fx * b.fx + b.fy * b.fy) - 1.0;
  };
  const ToolReport& first = rig.reports.front();
  EXPECT_EQ(first.condition, "fine");
  EXPECT_NEAR(first.wear->wear, expected(0.05 * MM), 1e-9);
  EXPECT_TRUE(std::isnan(first.wear->edge_wear));  // one feed alone
  EXPECT_GT(first.wear->wear_std, 0.01);           // gain of the sensor
  const ToolReport& last = rig.reports.back();
  EXPECT_EQ(last.condition, "coarse");
  EXPECT_NEAR(last.wear->wear, expected(0.2 * MM), 1e-9);
  EXPECT_LT(last.wear->wear, first.wear->wear);
  EXPECT_NEAR(last.wear->edge_wear, 0.5, 0.01);  // the directions of chip and edge force differ
  EXPECT_LT(last.wear->edge_wear_std, 0.25);
}

// At 50 revolutions a second the loss after one second is reported within two.
TEST(ToolMonitor, WearEndsAtALostTooth) {
  Rig rig;
  rig.knowTool("mill");
  rig.monitor.push(cut("cut", 0.0, 0.08 * MM));
  CuttingTeeth teeth;
  teeth.exit = PI / 2.0;
  teeth.missing = 2;
  teeth.missing_from = SPEED * 1.003;
  rig.run(0.0, 3.0, [&](double t, double a) { return teeth.at(t, a); });
  CuttingCondition none;
  none.stamp = 3.0;
  rig.monitor.push(none);
  rig.monitor.flush();
  ASSERT_FALSE(rig.reports.empty());
  const ToolReport& last = rig.reports.back();
  ASSERT_TRUE(last.loss);
  ASSERT_TRUE(last.wear);
  EXPECT_GE(last.wear->revolutions, 45u);
  EXPECT_LE(last.wear->revolutions, 53u);
}

// Two tools in turn: the coefficients of one are not those of the other, and a lost tooth is that of its
// tool.
TEST(ToolMonitor, KeepsSeveralToolsApart) {
  Rig rig;
  rig.knowTool("mill T1");
  CuttingCondition condition = cut("first", 0.0, 0.1 * MM);
  condition.tool_name = "mill T1";
  rig.monitor.push(condition);
  rig.run(0.0, 2.0, [&](double t, double a) { return broken(1.0).at(t, a); });
  EXPECT_TRUE(rig.monitor.loss());
  condition.stamp = 2.0;
  condition.name = "second";
  condition.tool_name = "mill T2";
  rig.monitor.push(condition);
  rig.run(2.0, 3.0, [&](double t, double a) { return meanForce(SHARP, condition.engagement, t, a); });
  EXPECT_FALSE(rig.monitor.loss());
  for (const ToolReport& report : rig.reports)
    EXPECT_NE(report.condition, "second");  // nothing is known of it
  condition.stamp = 3.0;
  condition.name = "third";
  condition.tool_name = "mill T1";
  rig.monitor.push(condition);
  rig.run(3.0, 3.5, [&](double t, double a) { return broken(0.0).at(t, a); });
  ASSERT_TRUE(rig.monitor.loss());
  EXPECT_EQ(rig.monitor.loss()->tooth, 3);
}

TEST(SharpTools, AModelIsThatOfItsNumberAndGeometry) {
  MachineModel one = model(), two = model();
  one.cutting = SHARP;
  two.tool->diameter = 6.0 * MM;
  two.cutting = SHARP;
  two.cutting->ktc *= 2.0;
  const SharpTools tools({{1, one}, {2, two}});
  CuttingCondition condition = cut("cut", 0.0, 0.1 * MM);
  condition.tool_name = "mill T1";
  ASSERT_TRUE(tools.of(condition));
  EXPECT_EQ(tools.of(condition)->value.ktc, SHARP.ktc);
  condition.tool_name = "mill T2";
  EXPECT_FALSE(tools.of(condition));  // other geometry
  condition.tool = *two.tool;
  ASSERT_TRUE(tools.of(condition));
  EXPECT_EQ(tools.of(condition)->value.ktc, 2.0 * SHARP.ktc);
  condition.tool_name = "mill T3";
  EXPECT_FALSE(tools.of(condition));
  const SharpTools only({{0, one}});
  condition.tool = tool();
  EXPECT_TRUE(only.of(condition));
  condition.tool.teeth = 3;
  EXPECT_FALSE(only.of(condition));
}

TEST(ToolMonitor, NoWearWithoutCoefficientsOrOffThePath) {
  Rig rig;
  CuttingCondition condition = cut("cut", 0.0, 0.1 * MM);
  rig.monitor.push(condition);
  rig.run(0.0, 1.0, [&](double t, double a) { return meanForce(SHARP, condition.engagement, t, a); });
  rig.knowTool("mill");
  condition.stamp = 1.0;
  condition.steady_from[0] = condition.steady_to[0] = 0.5;
  rig.monitor.push(condition);
  rig.run(1.0, 2.0, [&](double t, double a) { return meanForce(SHARP, condition.engagement, t, a); });
  rig.monitor.flush();
  EXPECT_THAT(rig.reports, testing::IsEmpty());
}

}  // namespace
}  // namespace smartmill::program
