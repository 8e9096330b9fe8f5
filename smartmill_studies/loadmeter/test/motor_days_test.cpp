#include "loadmeter/motor_days.h"

#include <gtest/gtest.h>

namespace smartmill::loadmeter {
namespace {

// The chain whole: the twin's motors, phase currents at 1 kHz, ranges, standard cuts, forces; then a day 15 K
// warmer with the calibration of the first.
TEST(MotorDays, currentsOfTheTwinBecomeForces) {
  MotorDay day;
  day.cuts = 40;
  day.diagonal = false;
  const auto standard = runDay(day, std::nullopt);
  ASSERT_EQ(standard.size(), 40u);
  const MotorCalibration calibration = calibrationOf(standard);
  ASSERT_TRUE(calibration.drive[0] && calibration.drive[1] && calibration.spindle);
  EXPECT_FALSE(calibration.drive[2]);  // never moved
  EXPECT_NEAR(calibration.drive[0]->newton_per_ampere.value, 200.0, 4.0);
  EXPECT_NEAR(calibration.drive[1]->newton_per_ampere.value, 200.0, 4.0);
  day.cuts = 12;
  day.diagonal = true;
  day.temperature = 35.0;
  day.seed = 2;
  const auto warm = runDay(day, calibration);
  const DayErrors errors = judgeDay(standard, calibration, warm);
  for (std::size_t a = 0; a < 3; ++a)
    std::printf("regression %.1f, ANFIS %.1f, old air %.1f N; estimate %.1f N, inside %.2f, dynamic %.2f\n",
                errors.regression[a], errors.anfis[a], errors.old_air[a], errors.estimate[a],
                errors.inside[a], errors.inside_rms[a]);
  // Windows of one cut share their errors: 12 cuts, each inside with 95 %.
  for (std::size_t a = 0; a < 3; ++a) {
    std::printf("windows: %.1f N, inside %.2f, dynamic %.2f\n", errors.window[a], errors.inside_window[a],
                errors.inside_window_rms[a]);
    EXPECT_GT(errors.inside_window[a], 0.8);
    EXPECT_GT(errors.inside_window_rms[a], 0.8);
  }
  // Table 1 of Cheng & Venuvinod has 29 N for a feed drive, 36 N for the tangential force.
  EXPECT_LT(errors.regression[0], 10.0);
  EXPECT_LT(errors.regression[1], 10.0);
  EXPECT_LT(errors.regression[2], 36.0);
  // Friction of the warm day taken for that of the cold one costs its change, 12 % of 150 N.
  EXPECT_GT(errors.old_air[0], errors.regression[0]);
  for (const MotorCut& cut : warm) {
    ASSERT_TRUE(cut.estimate);
    // Ten a second over 1.4 s, less settling and the first half second.
    EXPECT_GE(cut.windows.size(), 4u);
    for (std::size_t a = 0; a < 3; ++a) {
      EXPECT_LT(std::abs(cut.estimate->mean[a].value - cut.force[a]), 4.0 * cut.estimate->mean[a].std_dev);
      EXPECT_LT(std::abs(cut.estimate->rms[a].value - cut.rms[a]), 4.0 * cut.estimate->rms[a].std_dev);
    }
  }
}

}  // namespace
}  // namespace smartmill::loadmeter
