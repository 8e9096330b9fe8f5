#include "smartmill_kalman/compensation/matrix_compensation.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/force_channels.h"
#include "smartmill_core/testing/reference_case.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman_testing/plate_sensor.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 51200.0;      // [Hz]
constexpr double BANDWIDTH = 8000.0;  // [Hz]
constexpr std::size_t SAMPLES = 10240, BLOCK = 512;

const TransferMatrix& six() {
  static const TransferMatrix matrix = [] {
    std::mt19937 random(5);
    return identifyTransferMatrix(tapPlate(PlateSensor(), RATE, 6, 1, random), RATE);
  }();
  return matrix;
}

SampleBlock blockOf(const std::vector<std::vector<double>>& measured, std::size_t from) {
  SampleBlock block;
  block.stamp = static_cast<double>(from) / RATE;
  block.sample_rate = RATE;
  block.first_index = from;
  block.channels.assign(PLATE_CHANNELS.begin(), PLATE_CHANNELS.end());
  block.units = {"N", "N", "N", "N m", "N m", "N m"};
  for (std::size_t i = from; i < from + BLOCK; ++i) {
    for (const auto& channel : measured) block.samples.push_back(channel[i]);
  }
  return block;
}

/// Half-sines of a tooth at 667 Hz at a point that was not tapped.
std::array<std::vector<double>, 3> force() {
  std::array<std::vector<double>, 3> applied;
  for (std::size_t i = 0; i < SAMPLES; ++i) {
    const double t = static_cast<double>(i) / RATE, phase = std::fmod(t * 667.0, 1.0);
    const double share = std::clamp(std::min(t - 0.02, 0.17 - t) / 0.005, 0.0, 1.0);
    const double pulse = phase < 0.5 ? share * std::sin(units::TWO_PI * phase) : 0.0;
    applied[0].push_back(120.0 * pulse);
    applied[1].push_back(-80.0 * pulse);
    applied[2].push_back(60.0 * pulse);
  }
  return applied;
}

// Blocks keep index and stamp, are published after the latency, and give the force to 8 kHz
// where the plate measures several times too much (Bachrathy and Stepan section 3).
TEST(MatrixCompensation, GivesTheForceBackInTheStream) {
  const auto applied = force();
  std::mt19937 random(6);
  const auto measured = PlateSensor().measure(applied, {0.026, -0.020, 0.03}, RATE, 6, random);
  std::array<std::vector<double>, 3> found, raw;
  std::size_t blocks = 0;
  double measured_stamp = NAN;
  MatrixCompensation compensation(
      MatrixInverse(six(), BANDWIDTH), false,
      {[&](const ForceBlock& m) {
         measured_stamp = m.stamp;
         for (std::size_t axis = 0; axis < 3; ++axis)
           raw[axis].insert(raw[axis].end(), m.force[axis].begin(), m.force[axis].end());
       },
       [&](const ForceBlock& c) {
         EXPECT_EQ(c.first_index, blocks * BLOCK);
         EXPECT_DOUBLE_EQ(c.stamp, measured_stamp);
         ++blocks;
         for (std::size_t axis = 0; axis < 3; ++axis)
           found[axis].insert(found[axis].end(), c.force[axis].begin(), c.force[axis].end());
       }});
  for (std::size_t i = 0; i + BLOCK <= SAMPLES; i += BLOCK) compensation.handle(blockOf(measured, i));
  EXPECT_LT(blocks, SAMPLES / BLOCK);
  compensation.flush();
  EXPECT_EQ(blocks, SAMPLES / BLOCK);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_GT(bandError(raw[axis], applied[axis], RATE, 512, SAMPLES - 512, BANDWIDTH), 0.2);
    EXPECT_LT(bandError(found[axis], applied[axis], RATE, 512, SAMPLES - 512, BANDWIDTH), 0.05);
  }
}

TEST(MatrixCompensation, ClaimsNothingInAHoleAndRefusesWhatIsNotItsOwn) {
  std::vector<std::vector<double>> measured(6, std::vector<double>(SAMPLES, 1.0));
  measured[1][700] = NOT_A_NUMBER;
  std::vector<double> found;
  MatrixCompensation compensation(
      MatrixInverse(six(), BANDWIDTH), false,
      {{}, [&](const ForceBlock& c) { found.insert(found.end(), c.force[0].begin(), c.force[0].end()); }});
  for (std::size_t i = 0; i < 4 * BLOCK; i += BLOCK) compensation.handle(blockOf(measured, i));
  compensation.flush();
  ASSERT_EQ(found.size(), 4 * BLOCK);
  EXPECT_TRUE(std::isnan(found[700]));
  EXPECT_TRUE(std::isfinite(found[701]));
  EXPECT_EQ(compensation.notFinite(), 1u);
  SampleBlock other = blockOf(measured, 0);
  other.sample_rate = 25600.0;
  EXPECT_THROW(compensation.handle(other), Error);
  other = blockOf(measured, 0);
  other.channels[4] = "temperature";
  EXPECT_THROW(compensation.handle(other), Error);
}

}  // namespace
}  // namespace smartmill::kalman
