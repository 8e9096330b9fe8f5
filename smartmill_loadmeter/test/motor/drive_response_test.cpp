#include "smartmill_loadmeter/motor/drive_response.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_loadmeter/motor/self_calibration.h"

namespace smartmill::loadmeter {
namespace {

constexpr double RATE = 1000.0, PER_METRE = 400.0;

/// Trapezoidal velocity profile whose load passes a first-order lag, integrated in steps of 10 us.
DriveMove rapidTraverse(double bandwidth, unsigned seed) {
  constexpr double STEP = 1e-5, BEGIN = 0.1234, RAMP = 0.1, WAY = 0.12, ACCELERATION = 5.0;
  const double fastest = ACCELERATION * RAMP, brake = BEGIN + WAY / fastest;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 0.03);
  DriveMove move;
  move.sample_rate = RATE;
  move.begin = BEGIN + 0.012;
  move.distance = WAY;
  move.velocity = 1.02 * fastest;
  move.acceleration = 0.97 * ACCELERATION;
  double position = 0.0, velocity = 0.0, load = 0.0;
  const auto steps = static_cast<int>((brake + RAMP + 0.1) / STEP);
  for (int i = 0; i < steps; ++i) {
    const double t = i * STEP;
    const bool moves = t >= BEGIN && t < brake + RAMP;
    const double acceleration = !moves             ? 0.0
                                : t < BEGIN + RAMP ? ACCELERATION
                                : t < brake        ? 0.0
                                                   : -ACCELERATION;
    // 400 kg, friction of 150 N and 600 N s/m, 200 N/A of the range.
    const double load_current = moves ? (400.0 * acceleration + 150.0 + 600.0 * velocity) / 200.0 : 0.0;
    load += STEP * units::TWO_PI * bandwidth * (load_current - load);
    if (i % 100 == 0) {
      move.current.push_back(0.5 * load * std::sin(units::TWO_PI * PER_METRE * position + 0.7) +
                             noise(random));
    }
    position += STEP * velocity;
    velocity = std::max(0.0, velocity + STEP * acceleration);
  }
  return move;
}

TEST(DriveResponse, theLagIsIdentifiedFromAMove) {
  for (const double bandwidth : {20.0, 60.0, 120.0}) {
    const auto found = identifyResponse(rapidTraverse(bandwidth, 1), PER_METRE);
    ASSERT_TRUE(found) << bandwidth;
    EXPECT_NEAR(found->bandwidth.value, bandwidth, 3.0 * found->bandwidth.std_dev);
    EXPECT_LT(found->bandwidth.std_dev, 0.06 * bandwidth);
    EXPECT_NEAR(found->acceleration.value, 2.0, 0.02);
    EXPECT_NEAR(found->friction, (150.0 + 600.0 * 0.5) / 200.0, 0.08);
  }
  DriveMove other = rapidTraverse(60.0, 1);
  other.distance *= 0.5;  // not the move of this current
  EXPECT_FALSE(identifyResponse(other, PER_METRE));
  EXPECT_FALSE(identifyResponse({}, PER_METRE));
}

TEST(DriveResponse, theLagResponseFollowsItsFormula) {
  EXPECT_NEAR(lagResponse(60.0, 60.0).gain, std::sqrt(0.5), 1e-12);
  const double step = 1e-4;
  const double slope = (std::log(lagResponse(110.0, 60.0 * (1.0 + step)).gain) -
                        std::log(lagResponse(110.0, 60.0 * (1.0 - step)).gain)) /
                       (2.0 * step);
  EXPECT_NEAR(lagResponse(110.0, 60.0).slope, slope, 1e-6);
}

// 100 records of a range of 0.2 A that a cut modulates by 0.8 A at 100 Hz and by 0.1 A at 33 Hz.
TEST(DriveResponse, linesOfARangeHaveCalibratedStandardDeviations) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, 0.03);
  int inside = 0, half = 0;
  for (int k = 0; k < 100; ++k) {
    std::vector<double> current;
    const double phase = 0.06 * k;
    for (int i = 0; i < 800; ++i) {
      const double t = i / RATE;
      const double range = 0.2 + 0.8 * std::cos(units::TWO_PI * 100.0 * t + phase) +
                           0.1 * std::sin(units::TWO_PI * 100.0 / 3.0 * t);
      current.push_back(0.5 * range * std::sin(units::TWO_PI * 6.3 * t + 1.1) + noise(random));
    }
    const auto lines = fitSpectralLines(current, RATE, 6.3, cutLines(units::TWO_PI * 100.0 / 3.0, 3));
    ASSERT_EQ(lines.size(), 5u);
    EXPECT_NEAR(std::sqrt(lines[1].power), 0.8, 0.03);
    inside += std::abs(lines[0].power - 0.01) < 1.96 * lines[0].power_std;
    half += std::abs(lines[0].power - 0.01) < 0.6745 * lines[0].power_std;
    EXPECT_NEAR(lines[3].power, 0.0, 6.0 * lines[3].power_std);
  }
  EXPECT_GE(inside, 88);
  EXPECT_GE(half, 35);
  EXPECT_LE(half, 65);
}

TEST(DriveResponse, scatterIncreasesTheStandardDeviation) {
  EXPECT_NEAR(weightedMean({{60.0, 2.0}, {60.0, 2.0}}).std_dev, 2.0 / std::sqrt(2.0), 1e-12);
  EXPECT_GT(weightedMean({{50.0, 2.0}, {70.0, 2.0}}).std_dev, 9.0);
  EXPECT_THROW(weightedMean({}), Error);
}

/// A slide of 200 N/A along +X. @param velocity [m/s], force [N]
MotorMeasurement slideCurrent(double velocity, double force) {
  MotorMeasurement r;
  r.velocity[0] = velocity;
  r.range[0] = (150.0 + 600.0 * velocity + force) / 200.0;
  r.spindle_speed = 400.0;
  return r;
}

ForceEstimate dynamometer(double force) {
  ForceEstimate reference;
  reference.mean[0] = {-force, 0.02 * force};
  return reference;
}

// Slots along +X with forces by a dynamometer; feeds of the air moves between those of the cuts.
TEST(SelfCalibration, identifiesFrictionAndConstantFromOwnMovesAndCuts) {
  MotorParameters parameters;
  parameters.phase_per_metre = {PER_METRE, 0.0, 0.0};
  SelfCalibration self(parameters);
  for (const double v : {0.004, 0.013, 0.027, 0.053}) self.air(slideCurrent(v, 0.0), 100.0 * v);
  EXPECT_FALSE(self.calibration());
  for (const double force : {60.0, 100.0, 140.0})
    self.cut(slideCurrent(0.016 + 5e-5 * force, force), dynamometer(force));
  ASSERT_TRUE(self.calibration() && self.calibration()->drive[0]);
  const DriveCalibration& drive = *self.calibration()->drive[0];
  EXPECT_NEAR(drive.newton_per_ampere.value, 200.0, 1e-3 * 200.0);
  EXPECT_NEAR(drive.newton_per_ampere.std_dev, 0.02 * 200.0, 0.2);  // uncertainty of the dynamometer
  EXPECT_FALSE(self.calibration()->drive[1]);
  EXPECT_NE(self.text({}).find("X 200.0 +- 4.0 N/A from 3 cuts"), std::string::npos) << self.text({});
  self.clear();
  EXPECT_FALSE(self.calibration());
}

// A drive whose constant was changed: after MOST further tests nothing is left of the old ones.
TEST(SelfCalibration, keepsTheNewestTests) {
  MotorParameters parameters;
  parameters.phase_per_metre = {PER_METRE, 0.0, 0.0};
  SelfCalibration self(parameters);
  const auto test = [&self](double newton_per_ampere, std::size_t k) {
    for (const double force : {0.0, 60.0 + 0.4 * static_cast<double>(k)}) {
      MotorMeasurement r = slideCurrent(0.004 + 2e-4 * static_cast<double>(k), force);
      r.range[0] = *r.range[0] * 200.0 / newton_per_ampere;
      if (force > 0.0) self.cut(r, dynamometer(force));
      if (force == 0.0) self.air(r, 100.0 * static_cast<double>(k));
    }
  };
  for (std::size_t k = 0; k < 20; ++k) test(200.0, k);
  EXPECT_NEAR(self.calibration()->drive[0]->newton_per_ampere.value, 200.0, 0.2);
  for (std::size_t k = 0; k < SelfCalibration::MOST; ++k) test(250.0, k);
  const DriveCalibration& drive = *self.calibration()->drive[0];
  EXPECT_NEAR(drive.newton_per_ampere.value, 250.0, 0.25);
  EXPECT_EQ(drive.cuts, static_cast<int>(SelfCalibration::MOST));
}

}  // namespace
}  // namespace smartmill::loadmeter
