#include "smartmill_loadmeter/calibration/machine_calibration.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::loadmeter {
namespace {

using ::testing::HasSubstr;
using units::radPerSecFromRpm;

constexpr double STEP = 3e-4;                                 // [V] Dunwoody, below eq. 3.12
constexpr double KB = 1.43e-7, KTCF = -2.51e-5, K = 3.88e-4;  // eq. 3.8, 3.10
constexpr double ZERO_BELOW = 209.0;                          // [rad/s]

double rounded(double v) {
  return STEP * std::round(v / STEP);
}

double friction(double w) {
  return w < ZERO_BELOW ? 0.0 : KB * w * w + KTCF * w;
}

std::vector<AirCut> thesisAirCuts(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<AirCut> air;
  for (int rpm = 1000; rpm <= 20000; rpm += 1000) {
    const double w = radPerSecFromRpm(rpm);
    air.push_back({w, rounded(friction(w) + 2e-4 * normal(random)), 0.0});
  }
  return air;
}

TEST(IdleVoltage, reproducesTheFiguresOfTheThesis) {
  const IdleVoltage idle = fitIdleVoltage(thesisAirCuts(1), ZERO_BELOW, STEP);
  EXPECT_NEAR(idle.kb.value, 1.43e-7, 0.005e-7);    // printed digits
  EXPECT_NEAR(idle.ktcf.value, -2.51e-5, 0.05e-5);  // rounding of 3e-4 V over the speed range
}

TEST(IdleVoltage, standardDeviationsAreCalibrated) {
  Coverage kb, ktcf;
  for (int run = 0; run < Coverage::RUNS; ++run) {
    const IdleVoltage idle = fitIdleVoltage(thesisAirCuts(static_cast<unsigned>(run) + 10), ZERO_BELOW, STEP);
    kb.add(idle.kb.value - KB, idle.kb.std_dev);
    ktcf.add(idle.ktcf.value - KTCF, idle.ktcf.std_dev);
  }
  EXPECT_TRUE(kb.isCalibrated());
  EXPECT_TRUE(ktcf.isCalibrated());
}

TEST(IdleVoltage, namesWhatIsMissing) {
  EXPECT_THAT(errorOf([] { fitIdleVoltage({{100.0, 0.1, 0.0}}, 0.0, STEP); }), HasSubstr("1 usable"));
}

// Friction with Stribeck and warm-up terms (Armstrong).
std::vector<TimedAirCut> airCuts(double breakaway, double stribeck_rpm, double cold, double warmup,
                                 unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  FrictionLaw law;
  law.viscous = 3.0e-4;
  law.coulomb = 0.08;
  law.breakaway = breakaway;
  law.stribeck_speed = radPerSecFromRpm(stribeck_rpm);
  law.cold_ratio = cold;
  law.warmup_time = warmup;
  std::vector<TimedAirCut> cuts;
  double time = 0.0;
  for (const int round : {0, 1}) {
    for (int rpm = 1000; rpm <= 19000; rpm += 2000) {
      const double w = radPerSecFromRpm(round ? 20000 - rpm : rpm);
      const double v = K * w * law.torque(w, time);
      cuts.push_back({{w, v + 5e-5 * normal(random), 5e-5}, time});
      time += 60.0;
    }
  }
  return cuts;
}

TEST(FrictionLaws, theEvidenceSelectsTheTrueTerms) {
  const auto plain = fitFrictionLaws(airCuts(0.0, 2500, 0.0, 600.0, 1), K, 0.0).front();
  EXPECT_EQ(plain.terms.name(), "Coulomb and viscous");
  EXPECT_NEAR(plain.law.coulomb, 0.08, 3.0 * plain.std_dev[1]);
  const auto stribeck = fitFrictionLaws(airCuts(0.3, 2500, 0.0, 600.0, 2), K, 0.0).front();
  EXPECT_EQ(stribeck.terms.name(), "Coulomb and viscous, Stribeck");
  EXPECT_NEAR(stribeck.law.breakaway, 0.3, 3.0 * stribeck.std_dev[2]);
  EXPECT_NEAR(units::rpmFromRadPerSec(stribeck.law.stribeck_speed), 2500.0, 30.0);
  const auto cold = fitFrictionLaws(airCuts(0.0, 2500, 0.25, 500.0, 3), K, 0.0).front();
  EXPECT_EQ(cold.terms.name(), "Coulomb and viscous, warm-up");
  EXPECT_NEAR(cold.law.cold_ratio, 0.25, 3.0 * cold.std_dev[2]);
  const auto both = fitFrictionLaws(airCuts(0.3, 2500, 0.25, 500.0, 4), K, 0.0).front();
  EXPECT_EQ(both.terms.name(), "Coulomb and viscous, Stribeck, warm-up");
  EXPECT_NEAR(both.law.warmup_time, 500.0, 3.0 * both.std_dev[5]);
}

TEST(FrictionLaws, falseChoicesAreRare) {
  int wrong = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    const auto best = fitFrictionLaws(airCuts(0.0, 2500, 0.0, 600.0, seed + 100), K, 0.0).front();
    wrong += best.terms.stribeck || best.terms.warmup;
  }
  EXPECT_LE(wrong, 3);  // at most 5 % by chance
}

TEST(FrictionLaws, aLineThroughStribeckDataHasANegativeCoulombTerm) {
  std::vector<AirCut> air;
  for (int rpm = 1000; rpm <= 20000; rpm += 1000) {
    const double w = radPerSecFromRpm(rpm);
    // Viscous friction dominates above 2000 rpm and grows with speed (windage).
    air.push_back(
        {w, K * w * (2.5e-4 * w + 6e-8 * w * w + 0.05 * std::exp(-std::pow(rpm / 1500.0, 2))), 0.0});
  }
  EXPECT_LT(fitIdleVoltage(air, radPerSecFromRpm(2000), STEP).ktcf.value, 0.0);
}

}  // namespace
}  // namespace smartmill::loadmeter
