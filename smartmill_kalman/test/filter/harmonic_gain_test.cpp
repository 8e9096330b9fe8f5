#include "smartmill_kalman/filter/harmonic_gain.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include <gtest/gtest.h>

#include "smartmill_core/testing/reference_case.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;  // [Hz]

ModalModel dunwoody() {
  ModalModel model;
  model.modes = {{930.0, 0.02, 0.9}};
  model.direct = 0.1;
  return model;
}

ModalModel ideal() {
  ModalModel model;
  model.direct = 1.0;
  return model;
}

HarmonicDesign designAt(const ModalModel& sensor, double rpm, int most, double revolutions) {
  const double speed = units::radPerSecFromRpm(rpm), revolution = units::TWO_PI / speed;
  HarmonicDesign design{sensor, speed, RATE, 1.3, {}};
  const int harmonics = std::min(most, static_cast<int>(5000.0 * revolution));
  for (int n = 0; n <= harmonics; ++n) {
    const double passed = std::abs(sensor.response(n / revolution));
    design.settling.push_back(std::max(std::min(1.0, 2.0 * passed) * revolutions, 0.2) * revolution);
  }
  return design;
}

/// Largest difference over the largest element.
double difference(const std::vector<double>& a, const std::vector<double>& b) {
  double worst = 0.0, largest = 0.0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    worst = std::max(worst, std::abs(a.at(i) - b[i]));
    largest = std::max(largest, std::abs(b[i]));
  }
  return worst / largest;
}

// Another algorithm altogether, on all states together: the doubling of the Riccati equation, exact to 1e-12.
TEST(SpectralGain, IsTheRiccatiEquationsGain) {
  for (const ModalModel& sensor : {ReferenceCase::exactSensor(), dunwoody(), ideal()}) {
    for (const double rpm : {300.0, 6000.0, 13950.0, 21750.0, 60000.0}) {
      for (const double revolutions : {0.2, 1.3, 8.0}) {
        const HarmonicDesign design = designAt(sensor, rpm, 20, revolutions);
        const auto fast = spectralGain(design);
        ASSERT_TRUE(fast) << sensor.modes.size() << " modes " << rpm << " " << revolutions;
        const HarmonicGain dense = riccatiGain(design);
        EXPECT_LT(difference(fast->filter, dense.filter), 1e-10) << rpm << " " << revolutions;
        EXPECT_LT(difference(fast->smoothing, dense.smoothing), 1e-10) << rpm << " " << revolutions;
        EXPECT_NEAR(fast->variance, dense.variance, 1e-11 * dense.variance) << rpm << " " << revolutions;
      }
    }
  }
}

// A constant through an ideal sensor: p^2 = q (p + r), q = r (dt / tau)^2 dt / dt.
TEST(SpectralGain, SolvesTheScalarEquation) {
  HarmonicDesign design{ideal(), 900.0, RATE, 1.3, {2e-3}};
  const double r = 1.69, q = r * std::pow(1.0 / RATE / 2e-3, 2);
  const double p = 0.5 * (q + std::sqrt(q * q + 4.0 * q * r));
  const auto gain = spectralGain(design);
  ASSERT_TRUE(gain);
  EXPECT_NEAR(gain->filter[0], p / (p + r), 1e-13);
  EXPECT_NEAR(gain->smoothing[0], p, 1e-12 * p);
  EXPECT_NEAR(gain->variance, p + r, 1e-12);
}

// A random sensor, as taps may give one: every gain is found, none by the slow way.
TEST(SpectralGain, FindsEverySensorsGain) {
  for (int seed = 0; seed < 60; ++seed) {
    const auto share = [&](int k) {
      return std::fmod(std::abs(std::sin(12.9898 * (seed * 16 + k + 1))) * 43758.5, 1.0);
    };
    ModalModel sensor = ideal();
    for (int k = 0; k < 1 + seed % 4; ++k) {
      const double gain = 0.8 * share(3 * k) / (1 + seed % 4);
      sensor.modes.push_back({300.0 + 5000.0 * share(3 * k + 1), 0.003 + 0.1 * share(3 * k + 2), gain});
      sensor.direct -= gain;
    }
    for (const double revolutions : {0.2, 8.0})
      EXPECT_TRUE(spectralGain(designAt(sensor, 500.0 + 25000.0 * share(13), 200, revolutions))) << seed;
  }
}

// What no harmonic of passes has no gain this way.
TEST(SpectralGain, AbstainsWhereTheSensorPassesNothing) {
  ModalModel blind = ideal();
  blind.direct = 1e-8;
  EXPECT_FALSE(spectralGain(designAt(blind, 9000.0, 5, 1.0)));
}

}  // namespace
}  // namespace smartmill::kalman
