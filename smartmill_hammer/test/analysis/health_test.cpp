#include "smartmill_hammer/analysis/health.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace smartmill::hammer {
namespace {

constexpr HealthAllowance NONE{0.0, 0.0, 0.0, 0.0, 0.0};

MeasuredModes measured(std::mt19937& random, double stiffer = 1.0) {
  std::normal_distribution<double> normal;
  MeasuredModes m;
  for (const double f : {700.0, 1900.0, 3100.0})
    m.model.modes.push_back({f + 0.5 * normal(random), 0.03 * (1.0 + 0.02 * normal(random)),
                             1e-8 / stiffer * (1.0 + 0.01 * normal(random)), 0.5, 6e-4, 1e-10 / stiffer});
  return m;
}

// By the stated standard deviations alone: a thousand comparisons of nine unchanged quantities, and one with
// 10 % more stiffness (seven standard deviations of a difference).
TEST(Health, DistinguishesDriftFromChance) {
  std::mt19937 random(5);
  int false_alarms = 0, found = 0;
  for (int i = 0; i < 1000; ++i) {
    const MeasuredModes first = measured(random);
    false_alarms += !driftText(modeChanges(first, measured(random), NONE)).empty();
    found += driftText(modeChanges(first, measured(random, 1.1), NONE)).find("gain") != std::string::npos;
  }
  EXPECT_LE(false_alarms, 5);
  EXPECT_GE(found, 990);
}

TEST(Health, ReportsNewAndMissingModes) {
  std::mt19937 random(6);
  const MeasuredModes first = measured(random);
  MeasuredModes less = measured(random);
  less.model.modes.pop_back();
  EXPECT_NE(driftText(modeChanges(first, less)).find("gone"), std::string::npos);
  EXPECT_NE(driftText(modeChanges(less, first)).find("new"), std::string::npos);
  EXPECT_TRUE(valueChange("friction", {1.0}, {1.3}, 0.05).drifted());
  EXPECT_FALSE(valueChange("friction", {1.0}, {1.1}, 0.05).drifted());
}

}  // namespace
}  // namespace smartmill::hammer
