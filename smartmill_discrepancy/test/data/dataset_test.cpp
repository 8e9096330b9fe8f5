#include "smartmill_discrepancy/data/dataset.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"

namespace smartmill::discrepancy {
namespace {

// Noise of a known size beside lines and a drift that are far larger.
TEST(Noise, isFoundBetweenLines) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0.0, 0.7);
  std::vector<double> values;
  for (int i = 0; i < 8000; ++i)
    values.push_back(40.0 * std::sin(0.37 * i) + 9.0 * std::sin(2.2 * i) + 0.01 * i + normal(random));
  // Median of 2000 lines: 1.44 / sqrt(2000) in power, half of it in size; three of these.
  EXPECT_NEAR(noiseBetweenLines(values), 0.7, 0.7 * 0.05);
  EXPECT_THROW(noiseBetweenLines(std::vector<double>(10, 1.0)), Error);
}

// Conditions alone at the end of a range stay in the fit.
TEST(Heldout, liesInsideTheRangeOfTheFit) {
  std::vector<TestData> tests;
  for (const double feed : {0.025, 0.05, 0.075, 0.1, 0.125}) {
    TestData t;
    t.test.kind = TestKind::cut;
    t.test.spindle_speed = 600.0;
    t.test.engagement = Engagement{0.0, 3.14, 2e-3, feed * 1e-3};
    tests.push_back(t);
  }
  chooseHeldout(tests);
  EXPECT_FALSE(tests.front().heldout);
  EXPECT_FALSE(tests.back().heldout);
  EXPECT_EQ(tests[1].heldout + tests[2].heldout + tests[3].heldout, 2);
}

}  // namespace
}  // namespace smartmill::discrepancy
