#include "smartmill_stability/chatter/sound_features.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double RATE = 48000.0;
constexpr std::size_t FRAME = 3840;  // [samples]

SoundFeatures featuresOf(const std::vector<double>& sound, double rate = RATE) {
  SoundFrames frames;
  FeatureMaker maker;
  frames.reset(rate);
  for (std::size_t i = 0; i < sound.size(); ++i)
    if (frames.push(7.0 + static_cast<double>(i) / rate, sound[i], false) &&
        maker.push(frames.frame(), frames.step()))
      break;
  return maker.features();
}

std::vector<double> noise(std::size_t count, double size) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0.0, size);
  std::vector<double> values(count);
  for (double& v : values) v = normal(random);
  return values;
}

// Parseval: a sine has a mean square of half the square of its amplitude, all of it in three lines.
TEST(SoundFeatures, aSineHasItsRms) {
  std::vector<double> sound;
  for (std::size_t i = 0; i < 6 * FRAME; ++i)
    sound.push_back(0.2 * std::sin(units::TWO_PI * 1000.0 * static_cast<double>(i) / RATE));
  const SoundFeatures features = featuresOf(sound);
  EXPECT_NEAR(features.level, 0.2 / std::sqrt(2.0), 1e-9);
  EXPECT_DOUBLE_EQ(features.step, 12.5);
  EXPECT_DOUBLE_EQ(features.lowest, 50.0);
  EXPECT_DOUBLE_EQ(features.stamp, 7.0);
  EXPECT_NEAR(features.duration, 0.48, 1e-12);
  double near = 0.0, all = 0.0;
  for (std::size_t k = 0; k < features.amplitude.size(); ++k) {
    const double square = std::pow(features.amplitude[k], 2);
    all += square;
    if (std::abs(features.lowest + features.step * static_cast<double>(k) - 1000.0) < 15.0) near += square;
  }
  EXPECT_NEAR(std::sqrt(near), features.level, 1e-6);
  EXPECT_NEAR(std::sqrt(all), features.level, 1e-6);
}

// Nothing below 50 Hz or above 20 kHz is contained.
TEST(SoundFeatures, theBandIsFrom50HzTo20kHz) {
  for (const double frequency : {20.0, 22000.0}) {
    std::vector<double> sound;
    for (std::size_t i = 0; i < 6 * FRAME; ++i)
      sound.push_back(std::sin(units::TWO_PI * frequency * static_cast<double>(i) / RATE));
    EXPECT_LT(featuresOf(sound).level, 0.02) << frequency;
  }
  const SoundFeatures features = featuresOf(noise(6 * FRAME, 1.0));
  EXPECT_DOUBLE_EQ(features.lowest + features.step * static_cast<double>(features.amplitude.size() - 1),
                   20000.0);
  // 19,950 of 24,000 Hz of white noise; 9576 degrees of freedom.
  EXPECT_NEAR(std::pow(features.level, 2), 19950.0 / 24000.0,
              4.0 * 19950.0 / 24000.0 * std::sqrt(2.0 / 9576.0));
}

// The sound of half a second with its frames in another order and played backwards has the same features: the
// course of syllables, and with it the words, is not contained.
TEST(SoundFeatures, neitherOrderNorDirectionOfTheSoundIsContained) {
  std::vector<double> sound = noise(6 * FRAME, 1.0);
  for (std::size_t i = 0; i < sound.size(); ++i)  // syllables
    sound[i] *= std::pow(std::sin(units::TWO_PI * 2.7 * static_cast<double>(i) / RATE), 2);
  std::vector<double> other;
  for (const std::size_t frame : {4, 1, 5, 0, 3, 2}) {
    const auto from = sound.begin() + static_cast<std::ptrdiff_t>(frame * FRAME);
    // Backwards: the taper is symmetric about the middle of the frame except for its first sample, which is
    // 0.
    std::vector<double> part(from, from + FRAME);
    std::reverse(part.begin() + 1, part.end());
    other.insert(other.end(), part.begin(), part.end());
  }
  const SoundFeatures a = featuresOf(sound), b = featuresOf(other);
  ASSERT_EQ(a.amplitude.size(), b.amplitude.size());
  for (std::size_t k = 0; k < a.amplitude.size(); ++k)
    ASSERT_NEAR(a.amplitude[k], b.amplitude[k], 1e-5 * a.level) << k;
}

TEST(SoundFeatures, aMicrophoneAtALowRateHasFewerLines) {
  const SoundFeatures features = featuresOf(noise(6 * 640, 1.0), 8000.0);
  EXPECT_DOUBLE_EQ(features.step, 12.5);
  EXPECT_DOUBLE_EQ(features.lowest + features.step * static_cast<double>(features.amplitude.size() - 1),
                   4000.0);
}

}  // namespace
}  // namespace smartmill::stability
