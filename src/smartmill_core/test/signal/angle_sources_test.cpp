// Sources of the spindle angle: readings of a spindle whose angle is known in closed form.

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/angle_selector.h"
#include "smartmill_core/signal/encoder_reader.h"
#include "smartmill_core/signal/order_tracker.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr double RATE = 10000.0, SPEED = 420.0;  // [Hz], [rad/s]

double apart(double a, double b) {
  return std::remainder(a - b, units::TWO_PI);
}

SampleBlock counts(std::uint64_t first, int samples, double per_revolution, double speed, double wrap = 0.0,
                   double ahead = 0.0) {
  SampleBlock block{static_cast<double>(first) / RATE, RATE,       first,
                    {"other", ENCODER_CHANNEL},        {"V", "1"}, {}};
  for (int i = 0; i < samples; ++i) {
    const double time = block.timeOf(static_cast<std::size_t>(i));
    double count = std::floor(speed * time / units::TWO_PI * per_revolution + ahead);
    if (wrap > 0.0) count -= wrap * std::floor(count / wrap);
    block.samples.push_back(0.0);
    block.samples.push_back(count);
  }
  return block;
}

TEST(EncoderReader, AngleWithinACountAndSpeedWithinOnePerWindow) {
  for (const int bits : {0, 12}) {
    EncoderParameters parameters;
    parameters.counts_per_revolution = 2048.0;
    parameters.zero = 1.0;
    parameters.bits = bits;
    EncoderReader reader(parameters);
    std::size_t readings = 0;
    for (int b = 0; b < 20; ++b) {
      for (const SpindleAngle& reading : reader.push(
               counts(static_cast<std::uint64_t>(100 * b), 100, 2048.0, SPEED, bits > 0 ? 4096.0 : 0.0))) {
        ++readings;
        // The counter shows the last edge.
        EXPECT_NEAR(apart(reading.angle, SPEED * reading.stamp + 1.0), -0.5 * units::TWO_PI / 2048.0,
                    0.5 * units::TWO_PI / 2048.0 + 1e-9);
        EXPECT_NEAR(reading.speed, SPEED, 1.01 * units::TWO_PI / 2048.0 / 0.01);
      }
    }
    EXPECT_EQ(readings, 190u);  // each 1 ms, once the window of 10 ms is full
    EXPECT_EQ(reader.faults(), 0u);
  }
}

TEST(EncoderReader, ReversedCountersGapsJumpsAndNumbersThatAreNone) {
  EncoderParameters parameters;
  parameters.counts_per_revolution = 1000.0;
  parameters.reversed = true;
  EncoderReader reader(parameters);
  const auto readings = reader.push(counts(0, 300, 1000.0, -SPEED));
  ASSERT_FALSE(readings.empty());
  EXPECT_NEAR(apart(readings.back().angle, SPEED * readings.back().stamp), 0.0, units::TWO_PI / 1000.0);
  EXPECT_TRUE(reader.takeFault().empty());
  reader.push(counts(500, 300, 1000.0, -SPEED));
  EXPECT_EQ(reader.takeFault(), "samples are missing");
  reader.push(counts(800, 300, 1000.0, -SPEED, 0.0, 5e6));
  EXPECT_EQ(reader.takeFault().rfind("the counter has jumped by ", 0), 0u);
  SampleBlock none = counts(1100, 300, 1000.0, -SPEED, 0.0, 5e6);
  none.samples[401] = NOT_A_NUMBER;
  EXPECT_FALSE(reader.push(none).empty());
  EXPECT_EQ(reader.takeFault(), "a value is no number");
  EXPECT_THROW(reader.push(SampleBlock{0.1, RATE, 1400, {"x"}, {"V"}, {1.0}}), Error);
  parameters.counts_per_revolution = 0.0;
  EXPECT_THROW(EncoderReader{parameters}, Error);
}

/// Force of a cut with four teeth, a run-out and noise.
class Cut {
 public:
  Cut(double speed, double noise, std::uint64_t seed) : speed_(speed), noise_(noise), random_(seed) {}
  SampleBlock block(std::uint64_t first, bool cuts = true) {
    SampleBlock block{static_cast<double>(first) / RATE, RATE, first, {"fx"}, {"N"}, {}};
    for (std::size_t i = 0; i < 100; ++i) {
      const double angle = speed_ * block.timeOf(i);
      const double force = 120.0 + 80.0 * std::cos(4.0 * angle - 0.7) + 25.0 * std::cos(8.0 * angle + 0.2) +
                           15.0 * std::cos(angle + 1.0);
      block.samples.push_back((cuts ? force : 0.0) + noise_ * normal_(random_));
    }
    return block;
  }

 private:
  double speed_, noise_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

// The controller reads 1.5 % too high.
TEST(OrderTracker, FollowsTheSpeedAndTheAngleUpToAConstant) {
  OrderTracker tracker;
  Cut cut(SPEED, 20.0, 1);
  tracker.setCut(1.015 * SPEED, 4);
  std::vector<double> constants;
  for (std::uint64_t b = 0; b < 200; ++b) {
    const auto reading = tracker.push(cut.block(100 * b), 0);
    if (!reading) {
      EXPECT_LT(b, 26u);  // the first window
      continue;
    }
    EXPECT_NEAR(reading->angle.speed, SPEED, 5.0 * reading->speed_std);
    EXPECT_LT(reading->speed_std, 0.002 * SPEED);
    constants.push_back(apart(reading->angle.angle, SPEED * reading->angle.stamp));
    // The same constant throughout: a multiple of a tooth's pitch and the phase of the force.
    EXPECT_NEAR(apart(constants.back(), constants.front()), 0.0, 6.0 * reading->angle_std);
    EXPECT_LT(reading->angle_std, 0.03);
  }
  EXPECT_GT(constants.size(), 150u);
  EXPECT_NEAR(std::remainder(constants.front() + 0.7 / 4.0, units::TWO_PI / 4.0), 0.0, 0.05);
  EXPECT_EQ(tracker.locks(), 1u);
}

TEST(OrderTracker, StatesItsScatter) {
  Coverage speeds, angles;
  for (unsigned draw = 0; draw < Coverage::RUNS; ++draw) {
    OrderTracker tracker;
    Cut cut(SPEED, 150.0, 100 + draw);
    tracker.setCut(SPEED, 4);
    std::optional<OrderTracker::Reading> reading;
    for (std::uint64_t b = 0; b < 27 && !reading; ++b) reading = tracker.push(cut.block(100 * b), 0);
    ASSERT_TRUE(reading) << draw;
    speeds.add(reading->angle.speed - SPEED, reading->speed_std);
    angles.add(
        std::remainder(reading->angle.angle - SPEED * reading->angle.stamp + 0.7 / 4.0, units::TWO_PI / 4.0),
        reading->angle_std);
  }
  EXPECT_TRUE(speeds.isCalibrated());
  EXPECT_TRUE(angles.isCalibrated());
}

TEST(OrderTracker, GivesNothingWithoutACutOrItsTeethOrOverGaps) {
  OrderTracker tracker;
  Cut cut(SPEED, 20.0, 1);
  for (std::uint64_t b = 0; b < 60; ++b) EXPECT_FALSE(tracker.push(cut.block(100 * b), 0));  // no teeth
  tracker.setCut(SPEED, 4);
  Cut air(SPEED, 20.0, 2);
  for (std::uint64_t b = 60; b < 120; ++b) EXPECT_FALSE(tracker.push(air.block(100 * b, false), 0)) << b;
  std::uint64_t b = 120;
  while (b < 180 && !tracker.push(cut.block(100 * b), 0)) ++b;
  EXPECT_LT(b, 150u);
  EXPECT_FALSE(tracker.push(cut.block(100 * b + 500), 0));  // after a gap: a new window
  EXPECT_FALSE(tracker.locked());
  tracker.setCut(0.0, 4);
  for (std::uint64_t k = b + 6; k < b + 60; ++k) EXPECT_FALSE(tracker.push(cut.block(100 * k), 0));
}

/// Three sources of a spindle: an encoder, pulses whose zero is off, forces up to a constant.
struct Bench {
  AngleSelector selector{{{"encoder", 0.15, true}, {"pulses", 0.15, true}, {"forces", 0.15, false}}};
  std::vector<SpindleAngle> out;
  std::vector<std::string> changes;

  void run(double from, double to, bool encoder, bool pulses, bool forces) {
    for (double t = from; t < to - 1e-9; t += 0.005) {
      if (encoder) add(0, t, 0.0);
      if (pulses) add(1, t + 0.001, 0.2);
      if (forces) add(2, t + 0.002, 2.5);
      take(selector.advance(t + 0.003));
    }
  }
  void add(std::size_t source, double t, double off) {
    take(selector.push(source, {t, wrapped(SPEED * t + off), SPEED}));
  }
  void take(const std::vector<SpindleAngle>& readings) {
    out.insert(out.end(), readings.begin(), readings.end());
    const std::string change = selector.takeChange();
    if (!change.empty()) changes.push_back(change);
  }
  static double wrapped(double angle) { return angle - units::TWO_PI * std::floor(angle / units::TWO_PI); }
};

TEST(AngleSelector, TheNextSourceTakesOverWithoutAStepAndTheBetterOneComesBack) {
  Bench bench;
  bench.run(10.0, 13.0, true, true, true);
  EXPECT_EQ(bench.selector.active(), std::size_t{0});
  bench.run(13.0, 15.0, false, true, true);
  EXPECT_EQ(bench.selector.active(), std::size_t{1});
  bench.run(15.0, 17.0, false, false, true);
  EXPECT_EQ(bench.selector.active(), std::size_t{2});
  EXPECT_TRUE(bench.selector.related());
  bench.run(17.0, 17.5, true, false, true);
  bench.run(17.5, 19.0, true, true, true);
  EXPECT_EQ(bench.selector.active(), std::size_t{0});
  ASSERT_EQ(bench.changes.size(), 4u);
  EXPECT_EQ(bench.changes[0], "encoder");
  EXPECT_EQ(bench.changes[1], "pulses in place of encoder: no reading for 0.15 s");
  EXPECT_EQ(bench.changes[2], "forces in place of pulses: no reading for 0.15 s");
  EXPECT_EQ(bench.changes[3], "encoder in place of forces: works");
  for (std::size_t i = 0; i < bench.out.size(); ++i) {
    // All are turned to the encoder; what has come before the take-over is published then.
    EXPECT_NEAR(apart(bench.out[i].angle, SPEED * bench.out[i].stamp), 0.0, 1e-6) << bench.out[i].stamp;
    if (i > 0) {
      EXPECT_GT(bench.out[i].stamp, bench.out[i - 1].stamp);
      EXPECT_LT(bench.out[i].stamp, bench.out[i - 1].stamp + 0.011);
    }
  }
  EXPECT_NEAR(bench.selector.state(1).offset, -0.2, 1e-6);
  EXPECT_TRUE(bench.selector.state(1).offset_known);
}

TEST(AngleSelector, WithoutAnyOtherSourceTheForcesAreUpToAConstant) {
  Bench bench;
  bench.run(10.0, 11.0, false, false, true);
  EXPECT_EQ(bench.selector.active(), std::size_t{2});
  EXPECT_FALSE(bench.selector.related());
  EXPECT_EQ(bench.changes[0], "forces; up to a constant, tooth 1 is not known");
  bench.run(11.0, 13.0, false, true, true);
  EXPECT_EQ(bench.selector.active(), std::size_t{1});
  EXPECT_TRUE(bench.selector.related());
  EXPECT_NEAR(apart(bench.out.back().angle, SPEED * bench.out.back().stamp), 0.2, 1e-6);
}

TEST(AngleSelector, AtRestASourceThatKnowsTheAngleIsUsed) {
  AngleSelector selector({{"pulses", 0.5, true}, {"controller", 0.15, true}});
  std::vector<SpindleAngle> out;
  for (double t = 10.0; t < 12.0; t += 0.01) {
    for (const SpindleAngle& r : selector.push(0, {t, NOT_A_NUMBER, 0.0})) out.push_back(r);
    for (const SpindleAngle& r : selector.push(1, {t + 0.001, 1.25, 0.0})) out.push_back(r);
  }
  EXPECT_EQ(selector.active(), std::size_t{1});
  EXPECT_EQ(out.back().angle, 1.25);
}

TEST(AngleSelector, AnEarlierTimeBeginsAnew) {
  Bench bench;
  bench.run(100.0, 101.0, true, true, true);
  bench.out.clear();
  bench.run(10.0, 11.0, true, true, true);
  EXPECT_GT(bench.out.size(), 190u);
}

// Scatter of the two sources: the stated deviation of the average difference.
TEST(AngleSelector, StatesTheScatterOfTheOffset) {
  Coverage coverage;
  for (unsigned draw = 0; draw < Coverage::RUNS; ++draw) {
    std::mt19937_64 random(draw);
    std::normal_distribution<double> normal(0.0, 0.05);
    AngleSelector selector({{"encoder", 0.15, true}, {"pulses", 0.15, true}});
    for (double t = 10.0; t < 13.0; t += 0.01) {
      selector.push(0, {t, Bench::wrapped(SPEED * t), SPEED});
      selector.push(1, {t + 0.002, Bench::wrapped(SPEED * (t + 0.002) + 0.3 + normal(random)), SPEED});
    }
    coverage.add(selector.state(1).offset + 0.3, selector.state(1).offset_std);
  }
  EXPECT_TRUE(coverage.isCalibrated());
}

}  // namespace
}  // namespace smartmill
