#include "kalman/record_inversion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"
#include "smartmill_kalman_testing/plate_sensor.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 51200.0;  // [Hz]

// Section 2.1: three channels are valid only near the taps; section 2.2: six are valid everywhere.
TEST(RecordInversion, SixChannelsRestoreABouncingHammerWhereNobodyTapped) {
  const PlateSensor plate;
  std::mt19937 random(6);
  const std::array<double, 3> point{{0.026, -0.020, 0.03}}, direction{{0.30, 0.20, -0.9327}};
  const std::vector<double> contact = bouncingContact(RATE, 0.12, 0.01);
  // The hammer bounces, then rests with a force of 40 N.
  int bounces = 0;
  for (std::size_t i = 1; i < contact.size(); ++i) bounces += contact[i] > 0.0 && contact[i - 1] == 0.0;
  EXPECT_GE(bounces, 3);
  EXPECT_NEAR(contact.back(), 40.0, 0.5);
  std::array<std::vector<double>, 3> applied;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const double f : contact) applied[axis].push_back(f * direction[axis]);
  }
  const auto six = identifyTransferMatrix(tapPlate(plate, RATE, 6, 3, random), RATE);
  const auto three = identifyTransferMatrix(tapPlate(plate, RATE, 3, 3, random), RATE);
  const auto measured = plate.measure(applied, point, RATE, 6, random);
  const auto restored = invertRecord(six, measured, RATE, 8000.0);
  const auto by_three = invertRecord(three, {measured[0], measured[1], measured[2]}, RATE, 8000.0);
  // During the bounces, 5 to 45 ms: RMS of the difference over that of the truth.
  const auto error = [&](const std::vector<double>& f, std::size_t axis) {
    double sum = 0.0, whole = 0.0;
    for (std::size_t i = 256; i < 2304; ++i) {
      sum += std::pow(f[i] - applied[axis][i], 2);
      whole += std::pow(applied[axis][i], 2);
    }
    return std::sqrt(sum / whole);
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_GT(error(measured[axis], axis), 0.3) << axis;
    EXPECT_LT(error(restored[axis], axis), 0.05) << axis;
    EXPECT_LT(error(restored[axis], axis), 0.5 * error(by_three[axis], axis)) << axis;
  }
  // Position of the force, from static force and moment.
  std::array<double, 3> force{}, moment{};
  for (std::size_t i = 5000; i < 5600; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      force[c] += restored[c][i] / 600.0;
      moment[c] += restored[c + 3][i] / 600.0;
    }
  }
  const auto place = pointOfApplication(force, moment, point[2]);
  EXPECT_NEAR(place[0], point[0], 2e-4);
  EXPECT_NEAR(place[1], point[1], 2e-4);
}

// A small force next to two large ones requires the accuracy of the fit to all lines.
TEST(RecordInversion, ASmallForceBesideLargeOnes) {
  const PlateSensor plate;
  std::mt19937 random(7);
  std::array<std::vector<double>, 3> applied;
  for (int i = 0; i < 8192; ++i) {
    const double t = i / RATE, share = std::clamp(std::min(t - 0.02, 0.14 - t) / 0.005, 0.0, 1.0);
    const auto wave = [&](double f, double phase) { return std::cos(units::TWO_PI * f * t + phase); };
    applied[0].push_back(share * (80.0 + 60.0 * wave(667.0, 0.3) + 20.0 * wave(2667.0, 1.0)));
    applied[1].push_back(share * (200.0 + 150.0 * wave(667.0, 2.0) + 50.0 * wave(2667.0, 0.1)));
    applied[2].push_back(share * (12.0 + 9.0 * wave(667.0, 1.1) + 3.0 * wave(2667.0, 2.2)));
  }
  const auto matrix = identifyTransferMatrix(tapPlate(plate, RATE, 6, 3, random), RATE);
  const auto measured = plate.measure(applied, {{0.026, -0.020, 0.03}}, RATE, 6, random);
  const auto restored = invertRecord(matrix, measured, RATE, 8000.0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double sum = 0.0, whole = 0.0;
    for (std::size_t i = 1500; i < 6600; ++i) {
      sum += std::pow(restored[axis][i] - applied[axis][i], 2);
      whole += std::pow(applied[axis][i], 2);
    }
    EXPECT_LT(std::sqrt(sum / whole), 0.015) << axis;
  }
}

TEST(PointOfApplication, SolvesTheLever) {
  // r = (10, -20, 30) mm, F = (5, -7, -40) N: M = r x F.
  const std::array<double, 3> f{{5.0, -7.0, -40.0}};
  const std::array<double, 3> m{
      {-0.02 * -40.0 - 0.03 * -7.0, 0.03 * 5.0 - 0.01 * -40.0, 0.01 * -7.0 + 0.02 * 5.0}};
  const auto p = pointOfApplication(f, m, 0.03);
  EXPECT_NEAR(p[0], 0.01, 1e-12);
  EXPECT_NEAR(p[1], -0.02, 1e-12);
  EXPECT_TRUE(std::isnan(pointOfApplication({1.0, 0.0, 0.0}, m, 0.03)[0]));
}

}  // namespace
}  // namespace smartmill::kalman
