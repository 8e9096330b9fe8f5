#include "smartmill_exchange/items/force_features.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/units.h"

namespace smartmill::exchange {
namespace {

constexpr double RATE = 10000.0;                // [Hz]
constexpr double SPEED = 10.0 * units::TWO_PI;  // [rad/s] 1000 samples in a revolution
constexpr std::size_t BLOCK = 100;              // [1] samples

using Force = std::function<std::array<double, 3>(double angle)>;

/// Blocks of a force that depends on the spindle angle; the angle is read every 10 ms.
std::vector<ForceFeatures> features(ForceFeatureMaker& maker, const Force& force, double duration,
                                    double from = 0.0) {
  std::vector<ForceFeatures> all;
  const auto blocks = static_cast<std::size_t>(duration * RATE / BLOCK);
  for (std::size_t b = 0; b < blocks; ++b) {
    ForceBlock block;
    block.sample_rate = RATE;
    block.stamp = from + static_cast<double>(b * BLOCK) / RATE;
    block.status = ForceBlock::Status::compensated;
    maker.push(SpindleAngle{block.stamp, wrapped(SPEED * block.stamp), SPEED});
    for (std::size_t i = 0; i < BLOCK; ++i) {
      const std::array<double, 3> f = force(SPEED * (block.stamp + static_cast<double>(i) / RATE));
      for (std::size_t a = 0; a < 3; ++a) block.force[a].push_back(f[a]);
    }
    maker.push(block);
    for (const ForceFeatures& one : maker.take()) all.push_back(one);
  }
  return all;
}

// A rotating force of 100 N with 30 N along z: peak 100 N, effective values 100 / sqrt(2) and 30.
TEST(ForceFeatures, ClosedFormOfARotatingForce) {
  ForceFeatureMaker maker(0.15);
  const auto all = features(
      maker,
      [](double a) {
        return std::array<double, 3>{100.0 * std::cos(a), 100.0 * std::sin(a), -30.0};
      },
      2.0);
  ASSERT_GE(all.size(), 8u);
  for (const ForceFeatures& f : all) {
    EXPECT_EQ(f.revolutions, 2);  // of 0.1 s
    EXPECT_NEAR(f.peak, 100.0, 1e-9);
    EXPECT_NEAR(f.largest[0], 100.0, 100.0 * 2e-5);  // cosine of half a sample step
    EXPECT_NEAR(f.largest[2], 30.0, 1e-12);
    EXPECT_NEAR(f.rms[0], 100.0 / std::sqrt(2.0),
                0.1);  // a revolution may have one sample more or less: 1e-3
    EXPECT_NEAR(f.rms[2], 30.0, 1e-9);
    EXPECT_TRUE(f.peak_of_tooth.empty());
  }
}

// Three teeth of different height engaged around 45 degrees: tooth j is there at the spindle angle 45 degrees
// - j 120 degrees.
TEST(ForceFeatures, PeaksOfTeeth) {
  const double middle = units::radFromDeg(45.0), pitch = units::TWO_PI / 3;
  const std::array<double, 3> height{50.0, 70.0, 60.0};
  ForceFeatureMaker maker(0.05);
  maker.setTool(3, middle);
  const auto all = features(
      maker,
      [&](double angle) {
        double f = 0.0;
        for (std::size_t j = 0; j < 3; ++j) {
          const double immersion = wrapped(angle + static_cast<double>(j) * pitch);
          f += height[j] * std::exp(-std::pow((immersion - middle) / 0.3, 2));
        }
        return std::array<double, 3>{f, 0.0, 0.0};
      },
      1.0);
  ASSERT_GE(all.size(), 8u);
  for (const ForceFeatures& f : all) {
    ASSERT_EQ(f.peak_of_tooth.size(), 3u);
    for (std::size_t j = 0; j < 3; ++j) EXPECT_NEAR(f.peak_of_tooth[j], height[j], 1e-3 * height[j]) << j;
    EXPECT_NEAR(f.peak, 70.0, 0.1);
  }
}

TEST(ForceFeatures, RevolutionsWithInvalidSamplesAreLeftOut) {
  ForceFeatureMaker maker(0.05);
  const auto all = features(
      maker,
      [](double a) {
        return std::array<double, 3>{a > 30.0 && a < 31.0 ? NAN : 1.0, 0.0, 0.0};
      },
      1.0);
  // The fifth of ten revolutions is invalid; the first begins at angle 0 of the second, the last has not
  // ended.
  EXPECT_EQ(all.size(), 7u);
  for (const ForceFeatures& f : all) EXPECT_DOUBLE_EQ(f.rms[0], 1.0);
}

TEST(ForceFeatures, NothingWithoutASpindleAngle) {
  ForceFeatureMaker maker(0.05);
  ForceBlock block;
  block.sample_rate = RATE;
  for (std::vector<double>& axis : block.force) axis.assign(BLOCK, 1.0);
  for (int b = 0; b < 100; ++b) {
    block.stamp = 0.01 * b;
    maker.push(block);
  }
  EXPECT_TRUE(maker.take().empty());
}

}  // namespace
}  // namespace smartmill::exchange
