#include "smartmill_discrepancy/data/stream_shift.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

constexpr double RATE = 1000.0;  // [Hz]

// An axis that moves by one smooth step of 40 mm, in closed form: x = D (s - sin(2 pi s) / (2 pi)), s from 0
// to 1 within T, and the force -m a that a sensor on it indicates, recorded later.
RecordedTest step(double begin, double delay, double noise, std::uint64_t seed, bool periodic = false) {
  constexpr double DISTANCE = 0.04, TIME = 0.2, MASS = 25.0;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  RecordedTest test;
  test.test.kind = TestKind::move;
  test.test.sample_rate = RATE;
  std::vector<double> position, force;
  const auto phase = [&](double t) {
    const double s = (t - begin) / TIME;
    return periodic ? s : std::clamp(s, 0.0, 1.0);
  };
  for (int i = 0; i < 3000; ++i) {
    const double t = i / RATE, s = phase(t), late = phase(t - delay);
    test.record.time.push_back(t);
    position.push_back(DISTANCE * ((periodic ? 0.0 : s) - std::sin(units::TWO_PI * s) / units::TWO_PI));
    force.push_back(-MASS * DISTANCE * units::TWO_PI / TIME / TIME * std::sin(units::TWO_PI * late) +
                    noise * normal(random));
  }
  test.record.add("axis_x") = position;
  test.record.add("fx") = force;
  return test;
}

TEST(StreamShift, IsFoundWithinItsStandardDeviation) {
  for (const double delay : {0.1234, -0.31, 0.0, 0.9}) {
    std::vector<RecordedTest> tests;
    for (std::uint64_t k = 0; k < 4; ++k)
      tests.push_back(step(1.1 + 0.2 * static_cast<double>(k), delay, 10.0, k));
    const std::optional<ForceShift> shift = shiftOfForces(tests);
    ASSERT_TRUE(shift) << delay;
    EXPECT_EQ(shift->axis, 'x');
    // The force has an RMS of 157 N / sqrt(2) for 0.2 s of 3 s, the noise one of 10 N throughout.
    EXPECT_NEAR(shift->explained, 1.0 / (1.0 + 100.0 / (157.0 * 157.0 / 2.0 * 0.2 / (3.0 - std::abs(delay)))),
                0.03);
    EXPECT_NEAR(shift->delay, delay, 3.0 * shift->std_dev) << delay;
    EXPECT_LT(shift->std_dev, 1e-3);
  }
}

TEST(StreamShift, IsNotFoundWhereNothingShowsIt) {
  EXPECT_FALSE(shiftOfForces({}));
  EXPECT_FALSE(shiftOfForces({step(9.0, 0.1, 10.0, 1)}));       // the axis rests
  EXPECT_FALSE(shiftOfForces({step(1.0, 0.1, 1000.0, 1)}));     // noise
  EXPECT_FALSE(shiftOfForces({step(0.0, 0.1, 1.0, 1, true)}));  // any period fits
  RecordedTest stated = step(1.0, 0.1, 1.0, 1);
  stated.test.stream_offset["force"] = 0.1;
  EXPECT_FALSE(shiftOfForces({stated}));
}

// Correlation of the smoothed force with the derivative of the smoothed velocity, computed with numpy: 186.4
// to 186.8 ms for smoothing of 2 to 20 ms, in each record. (The README of the data states 187.8 ms.)
TEST(StreamShift, OfTheMeasuredAxisMotion) {
  SMARTMILL_SHARED_DATA(folder, "measured/axis_motion");
  const Campaign campaign = readCampaign(folder);
  std::vector<RecordedTest> tests;
  for (const CampaignTest& test : campaign.tests) tests.push_back({test, readRecord(campaign, test)});
  const std::optional<ForceShift> shift = shiftOfForces(tests);
  ASSERT_TRUE(shift);
  EXPECT_EQ(shift->axis, 'x');
  EXPECT_NEAR(shift->delay, 0.1866, 0.0004);
  EXPECT_LT(shift->std_dev, 0.001);
}

}  // namespace
}  // namespace smartmill::discrepancy
