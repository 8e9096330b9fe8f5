// Detection of chatter in synthetic sums of sines.

#include "smartmill_discrepancy/data/chatter.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr double RATE = 25600.0;
constexpr double SPEED = units::TWO_PI * 75.0;  // 4500 rpm

CampaignTest cut() {
  CampaignTest t;
  t.kind = TestKind::cut;
  t.sample_rate = RATE;
  t.spindle_speed = SPEED;
  return t;
}

// Tooth passing at 300 Hz of 100 N, runout of 20 N, 1 N of noise, and one more line.
Record forces(double amplitude, double frequency, std::size_t samples = 5120) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Record r;
  std::vector<double> x, y;
  for (std::size_t i = 0; i < samples; ++i) {
    const double t = static_cast<double>(i) / RATE;
    r.time.push_back(t);
    const double own = amplitude * std::sin(units::TWO_PI * frequency * t);
    const double periodic = 100.0 * std::sin(4.0 * SPEED * t) + 20.0 * std::sin(SPEED * t);
    x.push_back(300.0 + periodic + own + normal(random));
    y.push_back(-50.0 + 0.7 * periodic + 0.8 * own + normal(random));
  }
  r.add("fx") = x;
  r.add("fy") = y;
  return r;
}

TEST(FindChatter, FindsAnAsynchronousLine) {
  EXPECT_FALSE(findChatter(forces(0.0, 1111.0), cut(), 0).has_value());
  const auto chatter = findChatter(forces(80.0, 1111.0), cut(), 0);
  ASSERT_TRUE(chatter.has_value());
  // The second half lasts 0.1 s, of which seven revolutions are used: resolution 11 Hz.
  EXPECT_NEAR(chatter->frequency, 1111.0, 10.0);
  // The smaller share of both channels.
  const double all = std::sqrt(80.0 * 80.0 + 100.0 * 100.0 + 20.0 * 20.0);
  EXPECT_NEAR(chatter->share, 80.0 / all, 0.1 * 80.0 / all);
  EXPECT_NEAR(chatter->amplitude, 80.0, 12.0);
}

// Hum, drift and lines at orders of the spindle are not chatter.
TEST(FindChatter, IgnoresSlowAndSynchronousLines) {
  EXPECT_FALSE(findChatter(forces(80.0, 50.0), cut(), 0).has_value());
  EXPECT_FALSE(findChatter(forces(80.0, 75.0 * 13), cut(), 0).has_value());
}

TEST(FindChatter, IgnoresShortAndOtherRecords) {
  EXPECT_FALSE(findChatter(forces(80.0, 1111.0, 500), cut(), 0).has_value());
  EXPECT_FALSE(findChatter(forces(80.0, 1111.0), cut(), 5119).has_value());
  CampaignTest air = cut();
  air.kind = TestKind::air;
  EXPECT_FALSE(findChatter(forces(80.0, 1111.0), air, 0).has_value());
  Record one = forces(80.0, 1111.0);
  Record bare;
  bare.time = one.time;
  bare.add("fx") = one.column("fx");
  EXPECT_FALSE(findChatter(bare, cut(), 0).has_value());
}

}  // namespace
}  // namespace smartmill::discrepancy
