#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "air_cuts.h"
#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_discrepancy/explain/explain.h"

namespace smartmill::discrepancy {
namespace {

Dataset withHiddenFriction() {
  std::mt19937_64 random(5);
  MachineModel machine = spindleOnly();
  machine.effects.push_back(stribeckFriction(0.4, 2500.0));
  return airCuts(machine, spindleOnly(), random);
}

ExplainOptions cancelledAfter(int times) {
  ExplainOptions options;
  options.bench.threads = 1;
  options.bench.cancelled = [times, calls = 0]() mutable { return ++calls > times; };
  return options;
}

// A cancelled search reports it and writes the current model.
TEST(Explain, EndsWithTheEffectsFoundWhenInterrupted) {
  const Dataset data = withHiddenFriction();
  TemporaryFolder out;
  const Explanation at_once = explain(data, cancelledAfter(0), out.file("."));
  EXPECT_TRUE(at_once.interrupted);
  EXPECT_TRUE(at_once.effects.empty());
  EXPECT_NO_THROW(readMachineModel(out.file("model.yaml")));
  EXPECT_NEAR(at_once.after.fit, at_once.before.fit, 0.5 * at_once.before.fit);
  const Explanation whole = explain(data, cancelledAfter(1000000), out.file("."));
  EXPECT_FALSE(whole.interrupted);
  ASSERT_EQ(whole.effects.size(), 1u);
  EXPECT_EQ(whole.effects.front().name, "stribeck_friction");
}

// Each look at the clock takes a second, so that the stages end at known places.
ExplainOptions endedAfter(double seconds) {
  ExplainOptions options;
  options.bench.threads = 1;
  options.budget = seconds;
  options.elapsed = [now = 0.0]() mutable { return now += 1.0; };
  return options;
}

// A search without time is judged as usual, and the report states what was not tried.
TEST(Explain, EndsWithinItsBudget) {
  const Dataset data = withHiddenFriction();
  TemporaryFolder out;
  const Explanation at_once = explain(data, endedAfter(1.0), out.file("."));
  EXPECT_FALSE(at_once.interrupted);
  ASSERT_TRUE(at_once.spent_budget);
  EXPECT_EQ(*at_once.spent_budget, 1.0);
  EXPECT_TRUE(at_once.effects.empty());
  EXPECT_THAT(at_once.not_tried, testing::Contains("stribeck_friction"));
  EXPECT_NO_THROW(readMachineModel(out.file("model.yaml")));
  EXPECT_LE(at_once.after.fit, at_once.before.fit);
  const Explanation whole = explain(data, endedAfter(1e6), out.file("."));
  EXPECT_FALSE(whole.spent_budget);
  EXPECT_TRUE(whole.not_tried.empty());
  ASSERT_EQ(whole.effects.size(), 1u);
  EXPECT_EQ(whole.effects.front().name, "stribeck_friction");
}

// A model for which the twin gives no finite values is rejected in one line with test and channel.
TEST(Explain, RejectsAModelWithoutFiniteValuesOfTheTwin) {
  Dataset data = withHiddenFriction();
  data.nominal.spindle->viscous = std::numeric_limits<double>::quiet_NaN();
  TemporaryFolder out;
  try {
    explain(data, cancelledAfter(1000000), out.file("."));
    FAIL() << "not refused";
  } catch (const Error& error) {
    const std::string what = error.what();
    EXPECT_NE(what.find("air_600"), std::string::npos) << what;
    EXPECT_NE(what.find("load_meter"), std::string::npos) << what;
    EXPECT_EQ(what.find('\n'), std::string::npos) << what;
  }
}

}  // namespace
}  // namespace smartmill::discrepancy
