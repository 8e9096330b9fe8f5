#include "smartmill_core/signal/stream_shift.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/campaign/campaign.h"
#include "smartmill_core/campaign/record.h"
#include "smartmill_core/signal/derivative.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/shared_data.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

/// A random signal of 5 Hz to 80 Hz in closed form: a sum of sines, at any time.
class Motion {
 public:
  explicit Motion(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> frequency(5.0, 80.0), phase(0.0, units::TWO_PI);
    for (int i = 0; i < 40; ++i) sines_.emplace_back(frequency(random), phase(random));
  }
  double at(double time) const {
    double sum = 0.0;
    for (const auto& [f, p] : sines_) sum += std::sin(units::TWO_PI * f * time + p);
    return sum / std::sqrt(20.0);  // RMS 1
  }

 private:
  std::vector<std::pair<double, double>> sines_;
};

SignalPair pairOf(double delay, double noise, double rate, std::uint64_t seed) {
  const Motion motion(seed);
  std::mt19937_64 random(seed + 1);
  std::normal_distribution<double> normal;
  SignalPair pair;
  for (int i = 0; i < static_cast<int>(2.0 * rate); ++i) {
    const double t = i / rate;
    pair.early.push_back(motion.at(t));
    pair.late.push_back(-3.0 * (motion.at(t - delay) + noise * normal(random)));
  }
  return pair;
}

TEST(StreamShift, CorrelationFindsTheDelayOfAnyScaleAndSign) {
  constexpr double RATE = 1000.0;
  for (const double delay : {0.0377, -0.2213, 0.0}) {
    const auto shift = shiftByCorrelation({pairOf(delay, 0.5, RATE, 3)}, RATE);
    ASSERT_TRUE(shift) << delay;
    EXPECT_NEAR(shift->delay, delay, 3.0 * shift->std_dev);
    EXPECT_LT(shift->std_dev, 1e-3);
    EXPECT_NEAR(shift->explained, 1.0 / 1.25, 0.05);
  }
  EXPECT_FALSE(shiftByCorrelation({}, RATE));
  SignalPair unrelated = pairOf(0.0, 0.0, RATE, 5);
  unrelated.late = pairOf(0.0, 0.0, RATE, 99).late;
  EXPECT_FALSE(shiftByCorrelation({unrelated}, RATE));
}

// Noise six times as strong as the signal, so that the rounding to a sample is the smaller part.
TEST(StreamShift, CorrelationStatesItsScatter) {
  constexpr double RATE = 4000.0;
  Coverage coverage;
  for (int draw = 0; draw < Coverage::RUNS; ++draw) {
    const auto shift = shiftByCorrelation({pairOf(0.0514, 6.0, RATE, 100u + static_cast<unsigned>(draw))},
                                          RATE, {0.3, 0.005, 0.7, 0.5});
    if (shift) coverage.add(shift->delay - 0.0514, shift->std_dev);
  }
  EXPECT_TRUE(coverage.isCalibrated());
}

/// Half-sine hits with the ringing of the sensor's structure.
SampledSignal taps(double begin, double rate, double delay, double contact, double ringing, double noise,
                   std::uint64_t seed, const std::vector<double>& times) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  SampledSignal signal{begin, rate, {}};
  const auto samples = static_cast<int>(5.0 * rate);
  for (int i = 0; i < samples; ++i) {
    const double t = begin + i / rate;
    double value = 2.0 + noise * normal(random);
    for (const double at : times) {
      const double since = t - at - delay;
      if (since > 0.0 && since < contact) value += 100.0 * std::sin(units::PI * since / contact);
      if (since > contact && since < 0.1)
        value += ringing * std::exp(-since / 0.01) * std::sin(units::TWO_PI * 900.0 * (since - contact));
    }
    signal.values.push_back(value);
  }
  return signal;
}

const std::vector<double> TIMES{100.731, 101.402, 102.618, 104.1};

// Devices of other rates that begin at other times.
TEST(StreamShift, TapsFindTheDelayOfSensorsOfOtherRatesWithinASample) {
  for (const double delay : {0.0125, -0.3, 0.0}) {
    const SampledSignal hammer = taps(100.0, 51200.0, 0.0, 1e-3, 0.0, 0.3, 1, TIMES);
    const SampledSignal force = taps(99.93, 25600.0, delay, 1e-3, 40.0, 0.5, 2, TIMES);
    const auto shift = shiftByTaps(force, hammer);
    ASSERT_TRUE(shift) << delay;
    EXPECT_EQ(shift->events, TIMES.size());
    EXPECT_NEAR(shift->delay, delay, 3.0 * shift->std_dev + 1e-6);
    EXPECT_LT(shift->std_dev, 40e-6);
  }
}

TEST(StreamShift, TapsOfASlowerSensorAreUncertainByItsRise) {
  const auto shift = shiftByTaps(taps(100.0, 51200.0, 0.01, 4e-3, 0.0, 0.3, 1, TIMES),
                                 taps(100.0, 51200.0, 0.0, 1e-3, 0.0, 0.3, 2, TIMES));
  ASSERT_TRUE(shift);
  // A half sine rises from 0.1 to 0.9 of its peak in (asin 0.9 - asin 0.1) / pi = 0.324 of its length.
  EXPECT_NEAR(shift->std_dev, 0.324 * 3e-3 / std::sqrt(12.0), 30e-6);
  EXPECT_NEAR(shift->delay, 0.01, 2.0 * shift->std_dev);
}

TEST(StreamShift, TapsThatFitSeveralShiftsOrNoneAreNotUsed) {
  const SampledSignal two = taps(100.0, 10000.0, 0.0, 1e-3, 0.0, 0.3, 1, {101.0, 101.5});
  EXPECT_FALSE(shiftByTaps(two, taps(100.0, 10000.0, 0.0, 1e-3, 0.0, 0.3, 2, {101.3})));
  EXPECT_FALSE(shiftByTaps(two, taps(100.0, 10000.0, 0.0, 1e-3, 0.0, 0.3, 3, {})));       // noise only
  EXPECT_FALSE(shiftByTaps(two, taps(100.0, 10000.0, 1.7, 1e-3, 0.0, 0.3, 3, {101.0})));  // beyond the range
}

TEST(StreamShift, OneTapIsUncertainByTheSamples) {
  const auto shift = shiftByTaps(taps(100.0, 10000.0, 0.0, 1e-3, 0.0, 0.1, 1, {101.0}),
                                 taps(100.0, 1000.0, 0.02, 4e-3, 0.0, 0.1, 2, {101.0}));
  ASSERT_TRUE(shift);
  EXPECT_GT(shift->std_dev, 1e-3 / std::sqrt(12.0));
  EXPECT_NEAR(shift->delay, -0.02, 3.0 * shift->std_dev);
}

TEST(StreamShift, CommonTimesAreAveragedAndInterpolated) {
  SampledSignal fast{10.0, 1000.0, {}}, slow{10.25, 20.0, {}};
  for (int i = 0; i < 1000; ++i) fast.values.push_back(10.0 + i / 1000.0);
  for (int i = 0; i < 10; ++i) slow.values.push_back(10.25 + i / 20.0);
  const SignalPair pair = onCommonTimes(fast, slow, 100.0);
  ASSERT_EQ(pair.late.size(), 46u);  // 10.25 s to 10.7 s
  for (std::size_t i = 0; i < pair.late.size(); ++i) {
    EXPECT_NEAR(pair.late[i], 10.25 + 0.01 * static_cast<double>(i), 1e-3) << i;
    EXPECT_NEAR(pair.early[i], 10.25 + 0.01 * static_cast<double>(i), 1e-9) << i;
  }
  EXPECT_TRUE(onCommonTimes(fast, {20.0, 20.0, {1.0, 2.0}}, 100.0).late.empty());
}

// The position of the axis as a controller reports it fifty times a second against the force at 10 kHz: with
// the full records the delay is 186.4 to 186.8 ms (smartmill_discrepancy_stream_shift_test).
TEST(StreamShift, OfTheMeasuredAxisMotionByPositionsOfAController) {
  SMARTMILL_SHARED_DATA(folder, "measured/axis_motion");
  const Campaign campaign = readCampaign(folder);
  constexpr double CONTROLLER = 50.0, COMMON = 500.0;  // [Hz]
  std::vector<SignalPair> pairs;
  for (const CampaignTest& test : campaign.tests) {
    const Record record = readRecord(campaign, test);
    const auto step = static_cast<std::size_t>(test.sample_rate / CONTROLLER);
    SampledSignal position{record.time.front(), CONTROLLER, {}};
    for (std::size_t i = 0; i < record.time.size(); i += step)
      position.values.push_back(record.column("axis_x")[i]);
    const SampledSignal force{record.time.front(), test.sample_rate, record.column("fx")};
    const SampledSignal acceleration{position.begin, CONTROLLER,
                                     smoothedDerivative(position.values, CONTROLLER, 2, 1.0 / CONTROLLER)};
    pairs.push_back(onCommonTimes(force, acceleration, COMMON));
  }
  const auto shift = shiftByCorrelation(pairs, COMMON);
  ASSERT_TRUE(shift);
  EXPECT_NEAR(shift->delay, 0.1866, std::max(3.0 * shift->std_dev, 0.002));
  EXPECT_LT(shift->std_dev, 0.005);
}

}  // namespace
}  // namespace smartmill
