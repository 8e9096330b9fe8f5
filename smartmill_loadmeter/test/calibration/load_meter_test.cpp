#include "smartmill_loadmeter/calibration/load_meter.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using units::radPerSecFromRpm;

constexpr double K = 3.88e-4;          // [V/W] Dunwoody
constexpr double KB = 1.43e-7;         // [V s2/rad2] eq. 3.7
constexpr double KTCF = -2.51e-5;      // [V s/rad] eq. 3.8
constexpr double RESOLUTION = 3.0e-4;  // [V]

std::vector<AirCut> thesisAirCuts() {
  std::vector<AirCut> cuts;
  for (int rpm = 1000; rpm <= 20000; rpm += 1000) {
    const double omega = radPerSecFromRpm(rpm);
    cuts.push_back({omega, KB * omega * omega + KTCF * omega, 0.0});
  }
  return cuts;
}

TEST(Friction, thesisFigures) {
  const Friction f = fitFriction(thesisAirCuts(), K, radPerSecFromRpm(2000.0));
  // Three printed digits: 1.43e-7 / 3.88e-4 = 3.686e-4, printed as 3.70e-4 (eq. 3.11).
  EXPECT_NEAR(f.viscous, 3.70e-4, 0.02e-4);
  EXPECT_NEAR(f.coulomb, -0.0647, 0.00005);
  EXPECT_EQ(f.at(radPerSecFromRpm(1000.0)), 0.0);  // zero below 2000 rpm
  EXPECT_NEAR(f.at(radPerSecFromRpm(10000.0)), f.viscous * 1047.2 + f.coulomb, 1e-6);
}

TEST(Friction, refusesTooFewSpeeds) {
  EXPECT_THROW(fitFriction({}, K, 0.0), Error);
  EXPECT_THROW(fitFriction({{100.0, 0.01, 1e-4}}, K, 0.0), Error);
  EXPECT_THROW(fitFriction({{100.0, 0.01, 1e-4}, {100.5, 0.01, 1e-4}}, K, 0.0), Error);
  EXPECT_THROW(fitFriction({{100.0, 0.01, 1e-4}, {300.0, 0.03, 1e-4}}, K, 200.0), Error);  // one is below
  EXPECT_THROW(fitFriction({{100.0, NAN, 1e-4}, {300.0, 0.03, 1e-4}}, K, 0.0), Error);
}

TEST(Friction, standardDeviationsAreCalibrated) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const int runs = 200;
  int inside_b = 0, inside_c = 0, inside_torque = 0;
  for (int run = 0; run < runs; ++run) {
    std::vector<AirCut> cuts;
    for (const double rpm : {1000.0, 3000.0, 6000.0, 9000.0, 12000.0, 18000.0}) {
      const double omega = radPerSecFromRpm(rpm), sigma = 1e-4;
      cuts.push_back({omega, K * omega * (4.7e-4 * omega + 0.067) + sigma * normal(random), sigma});
    }
    const Friction f = fitFriction(cuts, K, 0.0);
    inside_b += std::abs(f.viscous - 4.7e-4) < 1.96 * std::sqrt(f.covariance[0]);
    inside_c += std::abs(f.coulomb - 0.067) < 1.96 * std::sqrt(f.covariance[3]);
    // The torque at a speed in the middle checks the covariance.
    const double w = 600.0;
    const double var = w * w * f.covariance[0] + 2.0 * w * f.covariance[1] + f.covariance[3];
    inside_torque += std::abs(f.at(w) - (4.7e-4 * w + 0.067)) < 1.96 * std::sqrt(var);
  }
  // 95 % of 200 runs with four sigma of the count (6 %); more are possible, because the scatter can only
  // increase the standard deviations.
  for (const int inside : {inside_b, inside_c, inside_torque}) {
    EXPECT_GT(inside, 0.89 * runs);
    EXPECT_LT(inside, runs);
  }
}

// White noise behind the meter's lag, rounded: the stated standard deviation of the mean agrees with the
// scatter of the means.
TEST(MeanVoltage, standardDeviationIsCalibratedForCorrelatedAndRoundedReadings) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const double interval = 0.02, tau = timeConstant(7.0), rho = std::exp(-interval / tau);
  for (const double noise : {2e-5, 1.5e-4, 1e-3}) {
    double squares = 0.0, stated = 0.0;
    int inside = 0;
    const int runs = 200;
    for (int run = 0; run < runs; ++run) {
      std::uniform_real_distribution<double> any(0.1, 0.2);
      const double truth = any(random);
      std::vector<double> readings;
      double state = noise * normal(random);
      for (int i = 0; i < 100; ++i) {
        state = rho * state + noise * std::sqrt(1.0 - rho * rho) * normal(random);
        readings.push_back(RESOLUTION * std::round((truth + state) / RESOLUTION));
      }
      const MeanVoltage m = meanVoltage(readings, interval, tau, RESOLUTION);
      squares += (m.mean - truth) * (m.mean - truth) / runs;
      stated += m.std_dev * m.std_dev / runs;
      inside += std::abs(m.mean - truth) < 1.96 * m.std_dev;
    }
    // Rounding errors without noise are uniform, so that all lie inside; with some noise the bound is
    // conservative.
    EXPECT_GT(stated / squares, 0.75) << noise;
    EXPECT_LT(stated / squares, 2.5) << noise;
    EXPECT_GT(inside, 0.90 * runs) << noise;
  }
}

}  // namespace
}  // namespace smartmill::loadmeter
