#include "loadmeter/motor_days.h"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

namespace smartmill::loadmeter {
namespace {

// The complete chain: motors of the twin, phase currents at 1 kHz, ranges, standard cuts, forces; then a day
// 15 K warmer with the calibration of the first.
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
  // Windows of one cut share their errors: 12 cuts with a coverage of 95 % each.
  for (std::size_t a = 0; a < 3; ++a) {
    std::printf("windows: %.1f N, inside %.2f, dynamic %.2f\n", errors.window[a], errors.inside_window[a],
                errors.inside_window_rms[a]);
    EXPECT_GT(errors.inside_window[a], 0.8);
    EXPECT_GT(errors.inside_window_rms[a], 0.8);
  }
  // The drives follow up to 60 Hz, as identified by rapid moves; the variation of moving axes is then
  // accurate to a few newtons (8 N by mean forces and mechanics alone), as stated.
  for (std::size_t a = 0; a < 2; ++a) {
    ASSERT_TRUE(warm.back().bandwidth[a]);
    EXPECT_NEAR(warm.back().bandwidth[a]->value, 60.0, 3.0 * warm.back().bandwidth[a]->std_dev);
    std::printf("variation: %.1f N, stated %.1f N\n", errors.variation.error[a], errors.variation.stated[a]);
    EXPECT_LT(errors.variation.error[a], 5.0);
    EXPECT_LT(errors.variation.error[a], 2.0 * errors.variation.stated[a]);
    EXPECT_GE(errors.inside_rms[a], 0.8);
  }
  // Table 1 of Cheng & Venuvinod has 29 N for a feed drive, 36 N for the tangential force.
  EXPECT_LT(errors.regression[0], 10.0);
  EXPECT_LT(errors.regression[1], 10.0);
  EXPECT_LT(errors.regression[2], 36.0);
  // Using the friction of the wrong day adds its change, 12 % of 150 N.
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

// No standard cuts: slots of the session with the dynamometer of the twin, by the Hall sensors and by a
// record of Servo Guide that begins at the feed block.
TEST(MotorDays, aSessionCalibratesItself) {
  for (const bool servo : {false, true}) {
    MotorDay day;
    day.cuts = 8;
    day.diagonal = day.rapid_moves = false;
    day.learn = day.force_sensor = true;
    day.servo = servo;
    const auto cuts = runDay(day, std::nullopt);
    ASSERT_TRUE(cuts.back().learnt) << servo;
    int drives = 0;
    for (std::size_t a = 0; a < 2; ++a) {
      const auto& drive = cuts.back().learnt->drive[a];
      if (!drive) continue;
      ++drives;
      // AxisDrive has 628 N/A of the force-producing current, MotorTraits 200 N/A of the range of a phase.
      const double truth = servo ? 628.0 : 200.0;
      EXPECT_NEAR(drive->newton_per_ampere.value, truth, 3.0 * drive->newton_per_ampere.std_dev)
          << servo << a;
      EXPECT_LT(drive->newton_per_ampere.std_dev, 0.1 * truth);
      const auto& sources = cuts.back().estimate->sources;
      if (cuts.back().cut.range[a]) {
        EXPECT_NE(std::find(sources.begin(), sources.end(), std::string("motor_") + "xy"[a]), sources.end());
        EXPECT_NE(servo, cuts.back().motors->other[a].has_value());  // a servo's current has a sign
      }
    }
    EXPECT_GE(drives, 1);
  }
}

}  // namespace
}  // namespace smartmill::loadmeter
