#include "smartmill_kalman/sensor/blind_mode.h"

#include <cmath>
#include <cstdio>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "../../src/sensor/blind_residuals.h"
#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/derivative_check.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 10000.0;                 // [Hz]
constexpr double SPEED = units::TWO_PI * 100.0;  // [rad/s]

std::vector<double> cut(const ModalModel& sensor, std::uint32_t seed, double rough) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  ModalFilter filter(sensor, RATE, Hold::zero_order);
  std::vector<double> samples;
  for (int i = 0; i < 12000; ++i) {
    const double angle = SPEED * i / RATE;
    const double force = 80.0 + 60.0 * std::cos(2.0 * angle) + 30.0 * std::cos(angle + 1.0) +
                         10.0 * std::cos(10.0 * angle) + rough * normal(random);
    const double measured = filter.step(force) + 0.5 * normal(random);
    if (i >= 2000) samples.push_back(measured);
  }
  return samples;
}

// Lines off and on the resonance, some of them near the expected power, where the deviance is a small
// difference.
TEST(BlindMode, DerivativesAgreeWithDifferences) {
  PowerLines lines;
  Eigen::VectorXd at(4);
  at << std::log(970.0), std::log(0.02), 0.3, 0.8;
  for (double f = 500.0; f < 1500.0; f += 7.0) {
    lines.frequency.push_back(f);
    lines.power.push_back(2.0);
  }
  for (std::size_t k = 0; k < lines.power.size(); ++k) {
    const double expected = expectedPower(lines.frequency[k], at, 2.0).value;
    if (k % 3 > 0) lines.power[k] = expected * (k % 3 == 1 ? 1.0 + 1e-5 : 0.2);
  }
  // The mean power is the unit of share and floor.
  const double unit = lines.mean() / 2.0;
  at[2] /= unit;
  at[3] /= unit;
  const fit::DerivativeGap gap = fit::checkDerivatives(BlindResiduals(lines), at);
  EXPECT_LT(gap.relative, 1e-6) << gap.row << " " << gap.column << " " << gap.given << " " << gap.numeric;
}

// One second of a cut, whose tenth harmonic lies at 1000 Hz near the mode.
TEST(BlindMode, FindsTheModeWithAnHonestDeviation) {
  ModalModel sensor;
  sensor.modes = {{970.0, 0.02, 1.0}};
  Coverage frequency, damping;
  for (std::uint32_t seed = 0; seed < Coverage::RUNS; ++seed) {
    const BlindMode found = findBlindMode(cut(sensor, seed, 3.0), RATE, SPEED, 600.0, 1500.0);
    EXPECT_NEAR(found.mode.frequency, 970.0, 0.01 * 970.0);
    EXPECT_GT(found.likelihood, 10.0);
    EXPECT_TRUE(std::isnan(found.mode.gain));
    frequency.add(found.mode.frequency - 970.0, found.mode.frequency_std);
    damping.add(found.mode.damping_ratio - 0.02, found.mode.damping_ratio_std);
  }
  EXPECT_TRUE(frequency.isCalibrated());
  EXPECT_TRUE(damping.isCalibrated());
}

TEST(BlindMode, SaysThatThereIsNone) {
  ModalModel ideal;
  ideal.direct = 1.0;
  EXPECT_LT(findBlindMode(cut(ideal, 1, 3.0), RATE, SPEED, 600.0, 1500.0).likelihood, 10.0);
  EXPECT_THROW(findBlindMode(cut(ideal, 1, 3.0), RATE, SPEED, 990.0, 1010.0), Error);
}

// Measured slots (sensor rings near 958 .. 985 Hz, by its README).
TEST(BlindMode, MeasuredSlotsAt6000) {
  SMARTMILL_SHARED_DATA(folder, "measured/slot_6000");
  const Campaign campaign = readCampaign(folder);
  for (const CampaignTest& test : campaign.tests) {
    const Record record = readRecord(campaign, test);
    for (const char* channel : {"fx", "fy"}) {
      const BlindMode found =
          findBlindMode(record.column(channel), test.sample_rate, test.spindle_speed, 700.0, 1300.0);
      if (std::string(channel) == "fx") {
        // README: a band near 958 .. 985 Hz.
        EXPECT_GT(found.likelihood, 10.0);
        EXPECT_NEAR(found.mode.frequency, 971.5, 13.5 + 2.0 * found.mode.frequency_std) << test.name;
      }
      std::printf("%s %s: %.1f +- %.1f Hz, damping %.4f +- %.4f, %.1f above the floor, likelihood %.0f\n",
                  test.name.c_str(), channel, found.mode.frequency, found.mode.frequency_std,
                  found.mode.damping_ratio, found.mode.damping_ratio_std, found.above, found.likelihood);
    }
  }
}

}  // namespace
}  // namespace smartmill::kalman
