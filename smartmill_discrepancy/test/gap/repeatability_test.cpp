#include "smartmill_discrepancy/gap/repeatability.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::discrepancy {
namespace {

struct Signal {
  std::vector<double> values, angle;
};

// Synchronous force with sharp corners and a non-integer number of samples per revolution, plus noise.
Signal makeSignal(double samples_a_turn, std::size_t samples, double noise, unsigned seed,
                  double asynchronous = 0.0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  Signal c;
  for (std::size_t i = 0; i < samples; ++i) {
    const double rotated = units::TWO_PI * static_cast<double>(i) / samples_a_turn + 0.7;
    c.angle.push_back(std::fmod(rotated, units::TWO_PI));
    double force = 40.0;
    for (int k = 1; k <= 60; ++k) force += 100.0 / (k * k) * std::cos(k * rotated - 0.3 * k * k);
    c.values.push_back(force + noise * normal(random) + asynchronous * std::sin(1.618034 * rotated));
  }
  return c;
}

double varianceOfOrders() {
  double sum = 0.0;
  for (int k = 1; k <= 60; ++k) sum += 0.5 * std::pow(100.0 / (k * k), 2);
  return sum;
}

// The floor of noise with standard deviation s is s, within four deviations of a chi-square.
TEST(Repeatability, FloorOfNoiseIsTheNoise) {
  for (const double samples_per_revolution : {384.0, 256.37, 143.9}) {
    for (const double noise : {0.5, 3.0}) {
      const Signal c = makeSignal(samples_per_revolution, 7680, noise, 3);
      const auto r = repeatability(c.values, c.angle);
      ASSERT_TRUE(r);
      const double free = 7680.0 - 0.9 * samples_per_revolution;
      EXPECT_NEAR(r->floor, noise, 4.0 * noise / std::sqrt(2.0 * free)) << samples_per_revolution;
      const double whole = varianceOfOrders() + noise * noise;
      EXPECT_NEAR(r->variance, whole, 0.02 * whole);  // the record ends within a revolution
      EXPECT_NEAR(1.0 - r->floor * r->floor / r->variance, varianceOfOrders() / whole, 2e-4);
    }
  }
}

// The lines of the synthetic signal: 100 / k^2, late by 0.3 k^2.
TEST(Repeatability, EstimatesMeanAndLines) {
  const Signal c = makeSignal(256.37, 7680, 0.0, 1);
  const std::vector<double> lines = repeatability(c.values, c.angle)->lines;
  EXPECT_NEAR(lines[0], 40.0, 1e-3);
  for (int k = 1; k <= 20; ++k) {
    const auto at = static_cast<std::size_t>(2 * k - 1);
    EXPECT_NEAR(lines[at], 100.0 / (k * k) * std::cos(0.3 * k * k), 1e-3) << k;
    EXPECT_NEAR(lines[at + 1], 100.0 / (k * k) * std::sin(0.3 * k * k), 1e-3) << k;
  }
}

TEST(Repeatability, SynchronousSignalHasNoFloor) {
  const Signal c = makeSignal(256.37, 4000, 0.0, 1);
  EXPECT_LT(repeatability(c.values, c.angle)->floor, 1e-3);
}

// A line between the orders (chatter) and noise are asynchronous.
TEST(Repeatability, LineBetweenOrdersIsAsynchronous) {
  const Signal c = makeSignal(300.0, 9000, 1.0, 5, 6.0);
  // Over 30 revolutions the orders absorb little of the sine.
  EXPECT_NEAR(repeatability(c.values, c.angle)->floor, std::sqrt(1.0 + 18.0), 0.15);
}

TEST(Repeatability, RequiresFiveRevolutions) {
  const Signal c = makeSignal(300.0, 1400, 1.0, 5);
  EXPECT_FALSE(repeatability(c.values, c.angle));
}

}  // namespace
}  // namespace smartmill::discrepancy
