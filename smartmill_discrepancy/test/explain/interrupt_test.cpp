#include <cmath>
#include <limits>
#include <string>

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
