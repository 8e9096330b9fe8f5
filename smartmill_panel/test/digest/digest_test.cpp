#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"
#include "smartmill_panel/digest/force_revolution.h"
#include "smartmill_panel/digest/force_spectrum.h"
#include "smartmill_panel/digest/force_strip.h"

namespace smartmill::panel {
namespace {

constexpr double RATE = 25600.0;
constexpr std::size_t BLOCK = 256;

// Passes blocks of force(time, axis) from the time begin to use.
template <class Force, class Use>
void feed(double begin, std::size_t blocks, const Force& force, const Use& use) {
  for (std::size_t b = 0; b < blocks; ++b) {
    ForceBlock block;
    block.first_index = b * BLOCK;
    block.sample_rate = RATE;
    block.stamp = begin + static_cast<double>(b * BLOCK) / RATE;
    for (std::size_t i = 0; i < BLOCK; ++i) {
      const double t = static_cast<double>(b * BLOCK + i) / RATE;
      for (std::size_t a = 0; a < 3; ++a) block.force[a].push_back(force(t, a));
    }
    use(block);
  }
}

TEST(ForceStrip, ContainsASinglePeak) {
  // One sample of 1000 N in two seconds: every nth sample would miss it, a mean would flatten it.
  std::vector<ForceStrip> strips;
  StripMaker maker({}, [&](const ForceStrip& strip) { strips.push_back(strip); });
  const double at = 1.2345;
  const auto peak = static_cast<std::size_t>(at * RATE);
  std::size_t sample = 0;
  feed(
      1000.0, 200,
      [&](double, std::size_t a) {
        const bool here = sample == peak && a == 1;
        if (a == 2) ++sample;
        return here ? 1000.0 : 1.0;
      },
      [&](const ForceBlock& block) { maker.push(block); });
  maker.flush();
  double largest = 0.0, when = 0.0;
  std::size_t bins = 0;
  for (const ForceStrip& strip : strips) {
    EXPECT_LE(strip.low.size() / 3, 20u);
    for (std::size_t k = 0; k < strip.high.size() / 3; ++k, ++bins) {
      EXPECT_EQ(strip.low[3 * k + 1], 1.0f);
      if (strip.high[3 * k + 1] > largest) {
        largest = strip.high[3 * k + 1];
        when = strip.stamp + static_cast<double>(k) * strip.bin;
      }
    }
  }
  EXPECT_EQ(bins, 400u);  // 2 s of 5 ms
  EXPECT_EQ(largest, 1000.0);
  EXPECT_LE(when, 1000.0 + at);
  EXPECT_GT(when + 0.005, 1000.0 + at - 1.0 / RATE);
}

TEST(ForceStrip, IsTheEnvelopeOfASine) {
  // A bin of 5 ms holds 4.65 periods of 930 Hz: both extremes, to the nearest sample's phase.
  const double amplitude = 120.0, frequency = 930.0;
  const double nearest = std::cos(units::PI * frequency / RATE);
  std::size_t bins = 0;
  StripMaker maker({}, [&](const ForceStrip& strip) {
    for (std::size_t k = 0; k < strip.high.size() / 3; ++k, ++bins) {
      EXPECT_GE(strip.high[3 * k], amplitude * nearest - 1e-3);
      EXPECT_LE(strip.high[3 * k], amplitude + 1e-3);
      EXPECT_LE(strip.low[3 * k], -amplitude * nearest + 1e-3);
    }
  });
  feed(
      0.0, 100, [&](double t, std::size_t) { return amplitude * std::sin(units::TWO_PI * frequency * t); },
      [&](const ForceBlock& block) { maker.push(block); });
  EXPECT_GE(bins, 180u);
}

TEST(ForceStrip, HandlesMissingSamplesAndABackwardJumpOfTime) {
  std::vector<ForceStrip> strips;
  StripMaker maker({}, [&](const ForceStrip& strip) { strips.push_back(strip); });
  const auto push = [&](double stamp, double value) {
    ForceBlock block;
    block.stamp = stamp;
    block.sample_rate = 1000.0;
    for (auto& axis : block.force) axis.assign(5, value);
    maker.push(block);
  };
  push(100.0, 1.0);
  push(100.02, NOT_A_NUMBER);  // three bins without samples, one without a valid sample
  push(50.0, 2.0);
  maker.flush();
  ASSERT_EQ(strips.size(), 2u);
  ASSERT_EQ(strips[0].low.size(), 15u);
  EXPECT_EQ(strips[0].low[0], 1.0f);
  for (std::size_t k = 3; k < 15; ++k) EXPECT_TRUE(std::isnan(strips[0].high[k])) << k;
  EXPECT_NEAR(strips[1].stamp, 50.0, 1e-9);
  EXPECT_EQ(strips[1].high[0], 2.0f);
}

TEST(AngleTrack, InterpolatesReadingsSeveralRevolutionsApart) {
  // 1234.5 rad/s read every 20 ms: 3.9 revolutions between two readings.
  AngleTrack track;
  const double speed = 1234.5, begin = 1.8e9;
  const auto truth = [&](double t) { return std::fmod(0.3 + speed * t, units::TWO_PI); };
  for (int k = 0; k <= 50; ++k) track.push({begin + 0.02 * k, truth(0.02 * k), speed});
  for (const double t : {0.0, 0.0031, 0.5137, 0.98765, 1.1}) {
    const auto found = track.at(begin + t);
    ASSERT_TRUE(found);
    // A stamp near 1.8e9 s resolves 0.24 us, 0.3 mrad here.
    EXPECT_NEAR(std::remainder(*found - truth(t), units::TWO_PI), 0.0, 1e-3) << t;
  }
  EXPECT_FALSE(track.at(begin + 2.0));
  EXPECT_FALSE(AngleTrack().at(0.0));
}

TEST(ForceRevolution, IsTheForceOverTheAngle) {
  // fx = 50 + 80 cos(4 phi) is synchronous with the spindle, fy alternates between revolutions.
  const double speed = units::radPerSecFromRpm(4500.0), begin = 500.0;
  AngleTrack track;
  for (int k = 0; k <= 100; ++k)
    track.push({begin + 0.01 * k, std::fmod(speed * 0.01 * k, units::TWO_PI), speed});
  RevolutionMaker maker({});
  EXPECT_FALSE(maker.take());
  feed(
      begin, 100,
      [&](double t, std::size_t a) {
        const double phi = speed * t;
        if (a == 0) return 50.0 + 80.0 * std::cos(4.0 * phi);
        if (a == 1) return std::fmod(phi, 2.0 * units::TWO_PI) < units::TWO_PI ? 10.0 : -10.0;
        return NOT_A_NUMBER;
      },
      [&](const ForceBlock& block) { maker.push(block, track); });
  const auto found = maker.take();
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->revolutions, 75.0, 0.01);
  EXPECT_DOUBLE_EQ(found->spindle_speed, speed);
  ASSERT_EQ(found->mean.size(), 3u * 256u);
  for (std::size_t k = 0; k < 256; ++k) {
    const double phi = (static_cast<double>(k) + 0.5) * units::TWO_PI / 256.0;
    // Slope 320 N/rad within half a bin of 12.3 mrad.
    EXPECT_NEAR(found->mean[k], 50.0 + 80.0 * std::cos(4.0 * phi), 4.0) << k;
    EXPECT_NEAR(found->mean[256 + k], 0.0, 1.0) << k;
    EXPECT_EQ(found->low[256 + k], -10.0f);
    EXPECT_EQ(found->high[256 + k], 10.0f);
    EXPECT_TRUE(std::isnan(found->mean[512 + k]));
  }
  EXPECT_FALSE(maker.take());
}

TEST(ForceSpectrum, HasAmplitudesAtTheirFrequencies) {
  // The line spacing is 3.125 Hz: 300 and 931.25 Hz are on lines.
  SpectrumMaker maker({});
  feed(
      10.0, 40,
      [](double t, std::size_t a) {
        return 500.0 + 100.0 * std::sin(units::TWO_PI * 300.0 * t) +
               (a == 0 ? 7.0 * std::cos(units::TWO_PI * 931.25 * t) : 0.0);
      },
      [&](const ForceBlock& block) { maker.push(block); });
  const auto found = maker.take();
  ASSERT_TRUE(found);
  EXPECT_DOUBLE_EQ(found->resolution, 3.125);
  EXPECT_LE(found->amplitude[0].size(), 512u);
  const auto line = [&](double f) { return static_cast<std::size_t>(f / found->step); };
  EXPECT_NEAR(found->amplitude[0][line(300.0)], 100.0, 0.01);
  EXPECT_NEAR(found->amplitude[1][line(300.0)], 100.0, 0.01);
  EXPECT_NEAR(found->amplitude[0][line(931.25)], 7.0, 0.01);
  EXPECT_LT(found->amplitude[1][line(931.25)], 0.01);
  EXPECT_LT(found->amplitude[2][0], 0.01);  // the mean is removed
  EXPECT_FALSE(maker.take());               // nothing new
}

TEST(ForceSpectrum, ReductionOfLinesLosesNoPeak) {
  SpectrumParameters coarse;
  coarse.lines = 40;
  SpectrumMaker maker(coarse);
  feed(
      10.0, 40, [](double t, std::size_t) { return 30.0 * std::sin(units::TWO_PI * 1234.0 * t); },
      [&](const ForceBlock& block) { maker.push(block); });
  const auto found = maker.take();
  ASSERT_TRUE(found);
  EXPECT_LE(found->amplitude[0].size(), 40u);
  // Between two lines the amplitude with a Hann window is at least 84.9 %.
  EXPECT_GT(found->amplitude[0][static_cast<std::size_t>(1234.0 / found->step)], 0.849 * 30.0);
}

TEST(ForceSpectrum, RestartsAfterLostSamples) {
  SpectrumMaker maker({});
  const auto sine = [](double t, std::size_t) { return std::sin(t); };
  feed(10.0, 31, sine, [&](const ForceBlock& block) { maker.push(block); });
  EXPECT_FALSE(maker.take());
  feed(10.0, 31, sine, [&](const ForceBlock& block) { maker.push(block); });  // the index starts again
  EXPECT_FALSE(maker.take());
}

}  // namespace
}  // namespace smartmill::panel
