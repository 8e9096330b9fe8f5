#include <array>
#include <cmath>
#include <complex>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_sim/world/plate.h"
#include "smartmill_sim/world/spindle_sensor.h"
#include "smartmill_sim/world/world.h"

namespace smartmill::sim {
namespace {

constexpr double RATE = 25600.0;  // [Hz]
constexpr double STEP = 1.0 / RATE;

SpindleSensorTraits quiet() {
  SpindleSensorTraits traits;
  traits.present = true;
  traits.zero = traits.drift = traits.thermal = traits.unbalance = 0.0;
  traits.noise = traits.noise_turning = traits.noise_cut = traits.bearing = 0.0;
  return traits;
}

/// Pairs' means (Burzoni eq. 3-1, z as a sum).
std::array<double, 3> means(const std::array<double, 6>& s) {
  return {0.5 * (s[0] - s[1]), -0.5 * (s[2] - s[3]), 0.5 * (s[4] + s[5])};
}

std::array<double, 3> meansUnder(SpindleSensor& sensor, const std::array<double, 3>& force) {
  std::array<double, 6> output{};
  for (int i = 0; i < 20000; ++i) {
    sensor.step(force, 0.0, 0.0);
    output = sensor.read();
  }
  return means(output);
}

// Burzoni Table 3 at the 139 mm of his Table 2; three digits of the defaults.
TEST(SpindleSensor, MatchesTable3AtItsLength) {
  SpindleSensor sensor(quiet(), STEP, RATE, 1);
  const auto x = meansUnder(sensor, {100.0, 0.0, 0.0});
  const auto y = meansUnder(sensor, {0.0, 100.0, 0.0});
  const auto z = meansUnder(sensor, {0.0, 0.0, 100.0});
  EXPECT_NEAR(100.0 / x[0], 18.002, 0.1);
  EXPECT_NEAR(100.0 / x[2], -341.97, 5.0);
  EXPECT_NEAR(100.0 / y[1], 17.961, 0.1);
  EXPECT_NEAR(100.0 / y[0], 27.726, 0.2);
  EXPECT_NEAR(100.0 / y[2], 130.84, 1.0);
  EXPECT_NEAR(100.0 / z[2], 62.46, 0.1);
}

// The moment at the ring is force times lever: the output is linear in the length, its reciprocal, the
// constant, is not.
TEST(SpindleSensor, MeasuredForceIsLinearInTheLength) {
  SpindleSensor sensor(quiet(), STEP, RATE, 1);
  std::array<double, 3> output{};
  for (std::size_t k = 0; k < 3; ++k) {
    sensor.setLength(0.1 + 0.04 * static_cast<double>(k));
    output[k] = meansUnder(sensor, {0.0, 100.0, 0.0})[1];
  }
  EXPECT_NEAR(output[1], 0.5 * (output[0] + output[2]), 1e-9);
  EXPECT_NEAR(output[2] / output[0], (0.18 + 0.146) / (0.1 + 0.146), 1e-9);
  EXPECT_GT(std::abs(0.5 * (1.0 / output[0] + 1.0 / output[2]) * output[1] - 1.0), 0.01);
  EXPECT_THROW(sensor.setLength(1.0), Error);
}

// A longer tool lowers the modes; the output of a washer is limited where its compression ends.
TEST(SpindleSensor, ModesFallWithLengthAndWashersUnload) {
  SpindleSensorTraits traits = quiet();
  traits.preload = {50.0, 50.0, 50.0};
  SpindleSensor sensor(traits, STEP, RATE, 1);
  const double before = sensor.modes(0).modes[0].frequency;
  sensor.setLength(0.278);
  EXPECT_NEAR(sensor.modes(0).modes[0].frequency, before * std::pow(0.5, 0.6), 1e-9);
  std::array<double, 6> output{};
  for (int i = 0; i < 20000; ++i) {
    sensor.step({0.0, 5000.0, 0.0}, 0.0, 0.0);
    output = sensor.read();
  }
  EXPECT_DOUBLE_EQ(output[2], -50.0);
  EXPECT_GT(output[3], 100.0);
}

TEST(SpindleSensor, NoiseGrowsFromRestToAirToCut) {
  SpindleSensorTraits traits = quiet();
  traits.noise = 0.03;
  traits.noise_turning = 0.25;
  traits.noise_cut = 0.01;
  const auto rms = [&](double speed, double force) {
    SpindleSensor sensor(traits, STEP, RATE, 3);
    double sum = 0.0, squares = 0.0;
    constexpr int N = 20000;
    for (int i = 0; i < 2 * N; ++i) {
      sensor.step({0.0, force, 0.0}, 0.0, speed);
      const double y = sensor.read()[3];
      if (i >= N) sum += y, squares += y * y;
    }
    return std::sqrt(squares / N - sum * sum / N / N);
  };
  EXPECT_NEAR(rms(0.0, 0.0), 0.03, 0.002);  // 4 sigma of 20,000 samples
  EXPECT_NEAR(rms(1000.0, 0.0), std::hypot(0.03, 0.25), 0.006);
  EXPECT_NEAR(rms(1000.0, 900.0), std::hypot(0.03, 0.25, 0.01 * 900.0 * 0.195 * 0.285), 0.012);
}

// Statically the feet carry the wrench of a force at any point; along z, without rotation, the natural
// frequency is that of the mass on its springs.
TEST(Plate, CarriesTheWrenchAndResonatesAtItsFrequency) {
  PlateTraits traits;
  traits.force_noise = traits.moment_noise = 0.0;
  traits.centre = {0.0, 0.0, 0.0};
  Plate plate(traits, STEP, 1);
  std::array<double, 6> output{};
  std::complex<double> line = 0.0;
  for (int i = 0; i < 60000; ++i) {
    plate.step({100.0, -50.0, 30.0}, {0.02, 0.01, -0.17}, {}, {});
    output = plate.read();
  }
  // M = r x F about the origin, r = (0.02, 0.01, 0.03).
  const std::array<double, 6> expected{
      100.0, -50.0, 30.0, 0.01 * 30.0 + 0.03 * 50.0, 0.03 * 100.0 - 0.02 * 30.0, -0.02 * 50.0 - 0.01 * 100.0};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(output[i], expected[i], 1e-6) << i;
  // Along z through the centre at the natural frequency: (1 + 2 i zeta) / (2 i zeta).
  Plate other(traits, STEP, 1);
  constexpr int N = 25600;
  for (int i = 0; i < 2 * N; ++i) {
    const double phase = units::TWO_PI * 4000.0 * i / RATE;
    other.step({0.0, 0.0, std::cos(phase)}, {0.0, 0.0, -0.2}, {}, {});
    const double z = other.read()[2];
    if (i >= N) line += 2.0 / N * z * std::polar(1.0, -phase);
  }
  // Linear between samples: sinc^2 of 4000 Hz at 25.6 kHz.
  const double x = units::PI * 4000.0 / RATE;
  const std::complex<double> i2z(0.0, 2.0 * traits.damping);
  EXPECT_NEAR(std::abs(line), std::abs((1.0 + i2z) / i2z) * std::pow(std::sin(x) / x, 2), 0.3);
}

TEST(SpindleSensor, RefusesListsOfDifferentLength) {
  WorldOptions options;
  options.spindle_sensor.x_damping = {0.1};
  EXPECT_THROW(options.validate(), Error);
}

}  // namespace
}  // namespace smartmill::sim
