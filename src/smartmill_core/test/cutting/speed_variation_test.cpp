#include "smartmill_core/cutting/speed_variation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

const SpeedVariation SINE{0.3, 0.125, SpeedVariation::Shape::sine};
const SpeedVariation TRIANGLE{0.3, 0.125, SpeedVariation::Shape::triangle};

TEST(SpeedVariation, angleIsTheIntegralOfTheSpeed) {
  constexpr double STEP = 1e-4;  // central differences: error of third order
  for (const SpeedVariation& v : {SINE, TRIANGLE}) {
    EXPECT_EQ(v.angle(0.0), 0.0);
    for (double turn = -70.0; turn < 120.0; turn += 0.37) {
      const double slope = (v.angle(turn + STEP) - v.angle(turn - STEP)) / (2.0 * STEP);
      EXPECT_NEAR(slope, v.speed(turn), 1e-5) << turn;
      EXPECT_NEAR(v.turn(v.angle(turn)), turn, 1e-12 * (1.0 + std::abs(turn)));
    }
    // A whole variation turns by the mean speed.
    EXPECT_NEAR(v.angle(units::TWO_PI / v.ratio), units::TWO_PI / v.ratio, 1e-12);
  }
}

TEST(SpeedVariation, sineAndTriangleReachTheAmplitude) {
  for (const SpeedVariation& v : {SINE, TRIANGLE}) {
    const double quarter = 0.25 * units::TWO_PI / v.ratio;
    EXPECT_NEAR(v.speed(0.0), 1.0, 1e-15);
    EXPECT_NEAR(v.speed(quarter), 1.3, 1e-12);
    EXPECT_NEAR(v.speed(3.0 * quarter), 0.7, 1e-12);
  }
  EXPECT_NEAR(TRIANGLE.speed(0.5 * 0.25 * units::TWO_PI / TRIANGLE.ratio), 1.15, 1e-12);
}

// Slope of the speed over time: amplitude x mean speed x phase speed (sine), 2 / pi of it (triangle).
TEST(SpeedVariation, acceleration) {
  EXPECT_NEAR(SINE.acceleration(400.0), 0.3 * 400.0 * 0.125 * 400.0, 1e-9);
  EXPECT_NEAR(TRIANGLE.acceleration(400.0), 2.0 / units::PI * 6000.0, 1e-9);
}

TEST(SpeedVariation, refusesWhatCannotBe) {
  EXPECT_THROW((SpeedVariation{1.0, 0.1}.validate()), Error);
  EXPECT_THROW((SpeedVariation{-0.1, 0.1}.validate()), Error);
  EXPECT_THROW((SpeedVariation{0.1, 0.0}.validate()), Error);
}

}  // namespace
}  // namespace smartmill
