#include "smartmill_hammer/analysis/health_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace smartmill {
namespace hammer {
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

IdleRecord air(double speed, double load) {
  IdleRecord r;
  r.loads.push_back({0.0, speed, load, 1e-4});
  return r;
}

// Day to day 0.2 % of a frequency is allowed and four deviations of it are 0.8 %: 0.3 % is no drift, 2 % is.
TEST(HealthWatch, WarnsOfModesThatDriftUntilTheNextGoodMeasurement) {
  HealthWatch watch;
  watch.measured(modes("T1", "x", 1000.0));
  EXPECT_TRUE(watch.warnings().empty());
  watch.measured(modes("T1", "x", 1003.0));
  EXPECT_TRUE(watch.warnings().empty());
  watch.measured(modes("T1", "x", 1023.0));
  ASSERT_EQ(watch.warnings().size(), 1u);
  EXPECT_THAT(watch.warnings()[0], HasSubstr("T1 tool_tip x differs from the last good measurement"));
  watch.measured(modes("T1", "x", 1023.0));
  EXPECT_TRUE(watch.warnings().empty());
}

// Another tool or direction is another thing: neither drift itself nor the end of one.
TEST(HealthWatch, ComparesLikeWithLike) {
  HealthWatch watch;
  watch.measured(modes("T1", "x", 1000.0));
  watch.measured(modes("T1", "y", 1300.0));
  watch.measured(modes("T2", "x", 700.0));
  EXPECT_TRUE(watch.warnings().empty());
  watch.measured(modes("T1", "x", 950.0));
  watch.measured(modes("T1", "y", 1300.0));
  ASSERT_EQ(watch.warnings().size(), 1u);
  EXPECT_THAT(watch.warnings()[0], HasSubstr("T1 tool_tip x"));
}

// 5 % of a load is allowed from day to day: four deviations of it are 20 %. Another speed is compared with
// none.
TEST(HealthWatch, WarnsOfLoadInAirAtTheSameSpeed) {
  HealthWatch watch;
  watch.turned("T1", air(600.0, 0.010));
  watch.turned("T1", air(1200.0, 0.030));
  watch.turned("T1", air(600.0, 0.0105));
  EXPECT_TRUE(watch.warnings().empty());
  watch.turned("T1", air(600.0, 0.015));
  ASSERT_EQ(watch.warnings().size(), 1u);
  EXPECT_THAT(watch.warnings()[0], HasSubstr("spindle in air with T1 differs from the first time: "));
  watch.turned("T2", air(600.0, 0.015));
  EXPECT_EQ(watch.warnings().size(), 1u);
  watch.turned("T1", air(600.0, 0.010));
  EXPECT_TRUE(watch.warnings().empty());
}

}  // namespace
}  // namespace hammer
}  // namespace smartmill
