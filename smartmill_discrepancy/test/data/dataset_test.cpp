#include "smartmill_discrepancy/data/dataset.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"

namespace smartmill::discrepancy {
namespace {

// Noise of a known RMS with far larger lines and drift.
TEST(Noise, IsEstimatedBetweenLines) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0.0, 0.7);
  std::vector<double> values;
  for (int i = 0; i < 8000; ++i)
    values.push_back(40.0 * std::sin(0.37 * i) + 9.0 * std::sin(2.2 * i) + 0.01 * i + normal(random));
  // Median of 2000 lines: 1.44 / sqrt(2000) in power, half of it in amplitude; three of these.
  EXPECT_NEAR(noiseBetweenLines(values), 0.7, 0.7 * 0.05);
  EXPECT_THROW(noiseBetweenLines(std::vector<double>(10, 1.0)), Error);
}

// Conditions alone at the end of a range stay in the fit.
TEST(Heldout, IsInsideTheRangeOfTheFit) {
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

// Six revolutions of each fitted cut, from its entry; records without angle, air cuts and held-out tests stay
// complete.
TEST(ShortenedDataset, KeepsTheFirstRevolutionsOfCuts) {
  Dataset data;
  for (int k = 0; k < 6; ++k) {
    TestData t;
    t.test.kind = k == 1 ? TestKind::air : TestKind::cut;
    t.test.spindle_speed = 2.0 * 3.14159265358979 * 100.0;  // 100 samples per revolution
    t.test.sample_rate = 10000.0;
    t.first_cut = k == 1 ? 4000 : 200;
    t.heldout = k == 2;
    t.phase_estimated = k >= 3;
    t.channels = {"fx"};
    t.record.time.assign(4000, 0.0);
    t.record.add("fx").assign(4000, 1.0);
    data.tests.push_back(t);
  }
  ASSERT_FALSE(shortenedDataset(data));  // 12800 of the 16000 samples of fitted cuts
  data.tests.resize(1);
  const auto shortened = shortenedDataset(data);
  ASSERT_TRUE(shortened);
  EXPECT_NEAR(static_cast<double>(shortened->tests.front().record.size()), 800.0, 1.0);
  EXPECT_EQ(shortened->tests.front().record.column("fx").size(), shortened->tests.front().record.size());
}

}  // namespace
}  // namespace smartmill::discrepancy
