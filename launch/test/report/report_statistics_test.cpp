#include "smartmill_launch/report/report_statistics.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::report {
namespace {

using units::TWO_PI;

ForceBlock block(std::uint64_t first, std::size_t size,
                 ForceBlock::Status status = ForceBlock::Status::compensated) {
  ForceBlock out;
  out.first_index = first;
  out.sample_rate = 1000.0;
  out.stamp = 5.0 + static_cast<double>(first) / out.sample_rate;
  out.status = status;
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t i = 0; i < size; ++i)
      out.force[a].push_back(static_cast<double>(first + i) + 0.1 * static_cast<double>(a));
  }
  return out;
}

Mode mode(double frequency) {
  Mode out;
  out.frequency = frequency;
  return out;
}

TEST(Figure, DifferencesInPercentAndStandardDeviations) {
  Figure figure{"Ktc", "N/mm2", 970.0, 10.0, 1000.0, {3.0, false}};
  EXPECT_DOUBLE_EQ(figure.percent(), -3.0);
  EXPECT_DOUBLE_EQ(figure.sigmas(), -3.0);
  EXPECT_TRUE(*figure.met());
  figure.estimate = 969.0;
  EXPECT_FALSE(*figure.met());
  // Relative to the magnitude of a negative truth.
  EXPECT_DOUBLE_EQ((Figure{"c", "N m", -11.0, 1.0, -10.0, {}}).percent(), -10.0);
}

TEST(Figure, WithoutTruthThereIsNoVerdict) {
  Figure figure{"Ktc", "N/mm2", 970.0, 10.0, NOT_A_NUMBER, {3.0, false}};
  EXPECT_TRUE(std::isnan(figure.percent()));
  EXPECT_FALSE(figure.met());
  figure.truth = 1000.0;
  figure.target.percent = NOT_A_NUMBER;
  EXPECT_FALSE(figure.met());
}

TEST(Figure, RawForceMustErrByMoreThanItsTarget) {
  EXPECT_TRUE(*(Figure{"raw", "N", 140.0, NOT_A_NUMBER, 100.0, {30.0, true}}).met());
  EXPECT_TRUE(*(Figure{"raw", "N", 60.0, NOT_A_NUMBER, 100.0, {30.0, true}}).met());
  EXPECT_FALSE(*(Figure{"raw", "N", 120.0, NOT_A_NUMBER, 100.0, {30.0, true}}).met());
}

TEST(Stiffness, StandardDeviationOfAnInverse) {
  Mode m;
  m.gain = 1.0 / 20e6;
  m.gain_std = 0.02 * m.gain;
  const auto [stiffness, std_dev] = stiffnessOf(m);
  EXPECT_NEAR(stiffness, 20e6, 1e-3);
  EXPECT_NEAR(std_dev / stiffness, 0.02, 1e-12);  // relative errors of x and 1/x agree to first order
}

TEST(Modes, NearestInFrequencyEachOnce) {
  const auto match =
      matchModes({mode(990.0), mode(1100.0), mode(4000.0)}, {mode(1000.0), mode(2500.0), mode(1105.0)});
  ASSERT_EQ(match.size(), 3u);
  EXPECT_EQ(match[0], 0u);
  EXPECT_EQ(match[1], 2u);
  EXPECT_EQ(match[2], 1u);
}

TEST(Modes, AnExtraOneHasNoPartner) {
  const auto match = matchModes({mode(999.0), mode(1001.5)}, {mode(1000.0)});
  EXPECT_EQ(match[0], 0u);
  EXPECT_FALSE(match[1]);
  EXPECT_FALSE(matchModes({mode(100.0)}, {mode(1000.0)})[0]);
}

TEST(ForceTrack, AlignsSamplesByIndexAcrossBlocks) {
  ForceTrack track;
  track.add(block(110, 10));
  track.add(block(100, 10));
  EXPECT_EQ(track.indexAt(5.105), 105u);
  EXPECT_EQ(track.indexAt(5.1041), 105u);
  const std::vector<double> y = track.axis(1, 105, 115);
  ASSERT_EQ(y.size(), 10u);
  for (std::size_t i = 0; i < y.size(); ++i) EXPECT_DOUBLE_EQ(y[i], 105.1 + static_cast<double>(i));
  EXPECT_THROW(track.axis(0, 115, 121), Error);
  EXPECT_THROW(track.axis(0, 95, 105), Error);
  const std::vector<double> at = track.axisAt(0, {5.0991, 5.1002, 5.1098, 5.119, 5.13});
  EXPECT_TRUE(std::isnan(at[0]) && std::isnan(at[4]));
  EXPECT_DOUBLE_EQ(at[1], 100.0);
  EXPECT_DOUBLE_EQ(at[2], 110.0);
  EXPECT_DOUBLE_EQ(at[3], 119.0);
  const std::vector<double> begin = track.axisWithGaps(0, 98, 102);
  EXPECT_TRUE(std::isnan(begin[0]) && std::isnan(begin[1]));
  EXPECT_DOUBLE_EQ(begin[3], 101.0);
}

TEST(ForceTrack, LongestSegmentWithoutGapAndOfOneStatus) {
  ForceTrack track;
  track.add(block(100, 10));
  track.add(block(120, 10, ForceBlock::Status::settling));
  track.add(block(130, 10));
  track.add(block(140, 10));
  EXPECT_EQ(track.covered(0, 1000), std::make_pair(std::uint64_t{120}, std::uint64_t{150}));
  EXPECT_EQ(track.covered(0, 1000, true), std::make_pair(std::uint64_t{130}, std::uint64_t{150}));
  EXPECT_EQ(track.covered(105, 135, true), std::make_pair(std::uint64_t{105}, std::uint64_t{110}));
}

TEST(MiddleRange, OfASineIsTwiceTheSineOf72Degrees) {
  // A sine spends a tenth of its time above sin(72 deg).
  std::vector<double> sine;
  for (int i = 0; i < 100000; ++i) sine.push_back(3.0 * std::sin(TWO_PI * i / 1000.0) + 40.0);
  EXPECT_NEAR(middleRange(sine), 2.0 * 3.0 * std::sin(0.4 * units::PI), 0.01);  // 1000 samples per period
}

TEST(NonperiodicShare, ForcedVibrationHasNone) {
  std::vector<double> forced;
  const double period = 123.4;  // [samples] of a revolution, fractional
  for (int i = 0; i < 20000; ++i) {
    forced.push_back(50.0 + 10.0 * std::sin(TWO_PI * i / period) + 4.0 * std::cos(3.0 * TWO_PI * i / period));
  }
  // Interpolation of the third harmonic at 41 samples per period.
  EXPECT_LT(nonperiodicShare(forced, period, 16), 1e-4);
}

TEST(NonperiodicShare, OfTwoLinesIsTheirEnergyRatio) {
  // Energy of a sine: half the amplitude squared. The chatter line is far from the harmonics.
  std::vector<double> both;
  const double period = 400.0;
  for (int i = 0; i < 100000; ++i) {
    both.push_back(10.0 * std::sin(TWO_PI * 2.0 * i / period) + 5.0 * std::sin(TWO_PI * 5.37 * i / period));
  }
  // The share of noise in the mean over 16 revolutions, 1/16, is added, which a line has not lost.
  EXPECT_NEAR(nonperiodicShare(both, period, 16), 16.0 / 15.0 * 25.0 / 125.0, 0.005);
}

TEST(NonperiodicShare, NoiseIsAllNonperiodic) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::vector<double> noise;
  for (int i = 0; i < 100000; ++i) noise.push_back(normal(random));
  // Tolerance 4 sigma of 86,000 samples.
  EXPECT_NEAR(nonperiodicShare(noise, 360.0, 16), 1.0, 0.005);
  EXPECT_TRUE(std::isnan(nonperiodicShare({1.0, 2.0}, 360.0, 16)));
}

TEST(Pockets, MaximaAboveTheFactor) {
  std::vector<double> speeds, depths;
  for (int i = 0; i <= 1000; ++i) {
    speeds.push_back(100.0 + i);
    depths.push_back(2.0 + std::cos(TWO_PI * i / 250.0));  // maxima at 0, 250, 500, 750, 1000: 3, minima 1
  }
  const auto found = pockets(speeds, depths, 1.5, 100.0);
  ASSERT_EQ(found.size(), 3u);  // the ends are no pockets
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_DOUBLE_EQ(found[k].spindle_speed, 350.0 + 250.0 * static_cast<double>(k));
    EXPECT_DOUBLE_EQ(found[k].depth, 3.0);
  }
  EXPECT_TRUE(pockets(speeds, depths, 3.5, 100.0).empty());
}

TEST(Pockets, AnInfinitePlateauIsTakenAtItsMiddle) {
  const double none = std::numeric_limits<double>::infinity();
  const auto found = pockets({1, 2, 3, 4, 5, 6, 7}, {1.0, 1.0, none, none, none, 1.0, 1.0}, 1.5, 10.0);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_DOUBLE_EQ(found[0].spindle_speed, 4.0);
  EXPECT_DOUBLE_EQ(found[0].depth, 10.0);
}

TEST(Pockets, OnAPlateauTheHighestPointDoesNotDecide) {
  std::vector<double> left{1, 1, 3.0, 2.9, 2.9, 2.9, 1, 1}, right{1, 1, 2.9, 2.9, 2.9, 3.0, 1, 1};
  const std::vector<double> speeds{1, 2, 3, 4, 5, 6, 7, 8};
  EXPECT_DOUBLE_EQ(pockets(speeds, left, 1.5, 10.0).at(0).spindle_speed, 4.5);
  EXPECT_DOUBLE_EQ(pockets(speeds, right, 1.5, 10.0).at(0).spindle_speed, 4.5);
}

// Two peaks, the second about 90 % of the first: as its height passes that level, the speed moves by little.
TEST(Pockets, ASecondPeakChangesTheSpeedContinuously) {
  const std::vector<double> speeds{1, 2, 3, 4, 5, 6, 7, 8};
  constexpr double STEP = 0.01;
  // The change of a weight times the distance of the peaks.
  constexpr double LARGEST = STEP / 3.0 / (0.95 - 0.85) * 2.0;
  double last = NAN;
  for (double second = 2.4; second < 3.0; second += STEP) {
    const double speed = pockets(speeds, {1, 1, 3.0, 2.6, second, 1, 1, 1}, 1.5, 10.0).at(0).spindle_speed;
    if (std::isfinite(last)) {
      EXPECT_NEAR(speed, last, LARGEST) << second;
    }
    last = speed;
  }
}

TEST(Interpolate, LinearInsideNaNOutside) {
  EXPECT_DOUBLE_EQ(interpolate({1.0, 3.0}, {10.0, 20.0}, 2.5), 17.5);
  EXPECT_DOUBLE_EQ(interpolate({1.0, 3.0}, {10.0, 20.0}, 1.0), 10.0);
  EXPECT_TRUE(std::isnan(interpolate({1.0, 3.0}, {10.0, 20.0}, 0.5)));
  EXPECT_TRUE(std::isnan(interpolate({1.0, 3.0}, {10.0, 20.0}, 3.5)));
}

}  // namespace
}  // namespace smartmill::report
