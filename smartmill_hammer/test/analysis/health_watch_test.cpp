#include "smartmill_hammer/analysis/health_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace smartmill::hammer {
namespace {

using ::testing::HasSubstr;

MeasuredModes modes(const std::string& tool, const std::string& direction, double frequency) {
  MeasuredModes m;
  m.tool = tool;
  m.point = "tool_tip";
  m.direction = direction;
  m.model.modes = {{frequency, 0.03, 1e-8, 0.5, 6e-4, 1e-10}, {2200.0, 0.02, 4e-9, 0.5, 6e-4, 1e-10}};
  return m;
}

AirCutRecord air(double speed, double load) {
  AirCutRecord r;
  r.loads.push_back({0.0, speed, load, 1e-4});
  return r;
}

// The allowance of a frequency is 0.2 %, four standard deviations are 0.8 %: 0.3 % is no drift, 2 % is one.
TEST(HealthWatch, WarnsOfDriftedModesUntilTheNextMeasurement) {
  HealthWatch watch;
  watch.addModes(modes("T1", "x", 1000.0));
  EXPECT_TRUE(watch.warnings().empty());
  watch.addModes(modes("T1", "x", 1003.0));
  EXPECT_TRUE(watch.warnings().empty());
  watch.addModes(modes("T1", "x", 1023.0));
  ASSERT_EQ(watch.warnings().size(), 1u);
  EXPECT_THAT(watch.warnings()[0], HasSubstr("T1 tool_tip x differs from the previous measurement"));
  watch.addModes(modes("T1", "x", 1023.0));
  EXPECT_TRUE(watch.warnings().empty());
}

// Another tool or direction neither begins nor ends a drift.
TEST(HealthWatch, ComparesLikeWithLike) {
  HealthWatch watch;
  watch.addModes(modes("T1", "x", 1000.0));
  watch.addModes(modes("T1", "y", 1300.0));
  watch.addModes(modes("T2", "x", 700.0));
  EXPECT_TRUE(watch.warnings().empty());
  watch.addModes(modes("T1", "x", 950.0));
  watch.addModes(modes("T1", "y", 1300.0));
  ASSERT_EQ(watch.warnings().size(), 1u);
  EXPECT_THAT(watch.warnings()[0], HasSubstr("T1 tool_tip x"));
}

// Slow drift is reported against the first measurement.
TEST(HealthWatch, ReportsEachMeasurementAgainstTheFirst) {
  HealthWatch watch;
  MeasuredModes m = modes("T1", "x", 1000.0);
  m.stamp = 1000.0;
  EXPECT_FALSE(watch.addModes(m)) << "the first";
  for (const double frequency : {1004.0, 1008.0, 1012.0}) {
    m.stamp += 86400.0;
    m.model.modes[0].frequency = frequency;
    const auto report = watch.addModes(m);
    ASSERT_TRUE(report);
    EXPECT_EQ(report->measured, "T1 tool_tip x");
    EXPECT_EQ(report->stamp, m.stamp);
    EXPECT_NEAR(report->days, (m.stamp - 1000.0) / 86400.0, 1e-12);
    ASSERT_EQ(report->changes.size(), 6u) << "frequency, damping and gain of two modes";
    EXPECT_EQ(report->changes[0].quantity, "frequency of the mode at 1000 Hz");
    EXPECT_EQ(report->changes[0].before, 1000.0);
    EXPECT_EQ(report->changes[0].now, frequency);
    EXPECT_EQ(report->changes[0].drifted(), frequency > 1010.0);
  }
  EXPECT_TRUE(watch.warnings().empty()) << "none differs from the one before";
}

// Air cuts are frequent: without a change they are reported once an hour.
TEST(HealthWatch, ReportsAirCutsWhereADriftBeginsOrEndsAndOnceAnHour) {
  HealthWatch watch;
  const auto at = [&](double stamp, double load) {
    AirCutRecord r = air(600.0, load);
    r.loads[0].stamp = stamp;
    return watch.addAirCut("T1", r);
  };
  EXPECT_FALSE(at(0.0, 0.010)) << "the first";
  const auto again = at(60.0, 0.0101);
  ASSERT_TRUE(again);
  EXPECT_EQ(again->measured, "spindle in air, T1");
  ASSERT_EQ(again->changes.size(), 1u);
  EXPECT_NEAR(again->changes[0].before, 0.010, 1e-12);
  EXPECT_FALSE(at(120.0, 0.0101));
  EXPECT_TRUE(at(180.0, 0.015)) << "a drift begins";
  EXPECT_FALSE(at(240.0, 0.015));
  EXPECT_TRUE(at(300.0, 0.010)) << "and ends";
  EXPECT_FALSE(at(3800.0, 0.010));
  EXPECT_TRUE(at(3901.0, 0.010)) << "an hour later";
}

// The allowance of a load is 5 %, four standard deviations are 20 %. Another speed has nothing to compare
// with.
TEST(HealthWatch, WarnsOfTheAirCutLoadAtTheSameSpeed) {
  HealthWatch watch;
  watch.addAirCut("T1", air(600.0, 0.010));
  watch.addAirCut("T1", air(1200.0, 0.030));
  watch.addAirCut("T1", air(600.0, 0.0105));
  EXPECT_TRUE(watch.warnings().empty());
  watch.addAirCut("T1", air(600.0, 0.015));
  ASSERT_EQ(watch.warnings().size(), 1u);
  EXPECT_THAT(watch.warnings()[0], HasSubstr("spindle in air with T1 differs from the first air cut: "));
  watch.addAirCut("T2", air(600.0, 0.015));
  EXPECT_EQ(watch.warnings().size(), 1u);
  watch.addAirCut("T1", air(600.0, 0.010));
  EXPECT_TRUE(watch.warnings().empty());
}

}  // namespace
}  // namespace smartmill::hammer
