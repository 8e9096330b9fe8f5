#include "smartmill_kalman/filter/fixed_lag_smoother.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/force_block.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/force_compensation.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;  // [Hz]

// A random walk with measurement noise, the textbook case: variance p - p^2 / s (1 - a^(2 L + 2)) / (1 - a^2)
// with s = p + r, a = r / s and p^2 = q (p + r).
TEST(FixedLagSmoother, HasTheVarianceOfTheTextbook) {
  ModalModel ideal;
  ideal.direct = 1.0;
  HarmonicFilterParameters parameters;
  parameters.max_harmonics = 0;
  constexpr double SPEED = 100.0, TAU = 10.0 / RATE, Q = 1.0 / 100.0;  // a memory of 10 samples
  parameters.settling_revolutions = parameters.memory_revolutions = TAU * SPEED / units::TWO_PI;
  const double p = 0.5 * (Q + std::sqrt(Q * Q + 4.0 * Q)), s = p + 1.0, a = 1.0 / s;
  std::vector<double> found;
  for (const std::size_t lag : {0u, 3u, 10u, 40u}) {
    HarmonicFilter filter(ideal, SPEED, RATE, parameters);
    FixedLagSmoother smoother;
    std::mt19937 random(5);
    std::normal_distribution<double> noise(0.0, 1.0);
    std::vector<double> truth;
    double force = 0.0, squares = 0.0;
    constexpr std::size_t COUNT = 60000;
    for (std::size_t i = 0; i < COUNT; ++i) {
      force += std::sqrt(Q) * noise(random);
      truth.push_back(force);
      smoother.step(filter, force + noise(random));
      if (smoother.pending() == lag + 1) squares += std::pow(smoother.takeSmoothed(1)[0] - truth[i - lag], 2);
    }
    const double power = static_cast<double>(lag) + 1.0;
    const double variance = p - p * p / s * (1.0 - std::pow(a, 2.0 * power)) / (1.0 - a * a);
    // 60000 samples of which some 20 hang together: 3000 independent ones, 2.6 % of their variance.
    EXPECT_NEAR(squares / COUNT, variance, 0.08 * variance) << lag;
    found.push_back(squares);
  }
  EXPECT_LT(found[1], found[0]);
  EXPECT_LT(found[2], found[1]);
  EXPECT_LT(found[3], found[2]);
}

// With a lag as long as the record it is the fixed-interval smoother.
TEST(FixedLagSmoother, OverTheWholeRecordIsTheFixedIntervalOne) {
  const double speed = units::radPerSecFromRpm(21750.0);
  HarmonicFilterParameters parameters;
  parameters.memory_revolutions = parameters.settling_revolutions;
  HarmonicFilter filter(ReferenceCase::exactSensor(), speed, RATE, parameters), other = filter;
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<double> measured;
  for (int i = 0; i < 3000; ++i) measured.push_back(noise(random) + 20.0 * std::cos(4.0 * speed * i / RATE));
  FixedLagSmoother smoother;
  for (const double sample : measured) smoother.step(filter, sample);
  ASSERT_EQ(filter.memory().restarts(), 0u);
  const std::vector<double> force = smoother.takeSmoothed(measured.size()), whole = other.smooth(measured);
  ASSERT_EQ(force.size(), whole.size());
  for (std::size_t i = 0; i < force.size(); ++i) ASSERT_NEAR(force[i], whole[i], 1e-8) << i;
}

struct Outcome {
  std::vector<double> force;
  std::size_t before_end = 0;  // blocks out before the flush
};

Outcome runOf(const ReferenceRecord& record, double lag) {
  constexpr std::size_t BLOCK = 256;
  CompensationParameters parameters;
  parameters.lag = lag;
  parameters.filter.memory_revolutions = 2.0;  // with a longer memory the lag gains less
  Outcome run;
  std::size_t blocks = 0;
  ForceBlock measured;
  ForceOutputs outputs;
  outputs.measured = [&](const ForceBlock& m) {
    EXPECT_EQ(m.first_index, 1000 + BLOCK * blocks);
    EXPECT_EQ(m.force[0][7], record.measured[0][BLOCK * blocks + 7]);
    measured = m;
  };
  outputs.compensated = [&](const ForceBlock& c) {
    EXPECT_EQ(c.first_index, measured.first_index);
    EXPECT_EQ(c.stamp, measured.stamp);
    run.force.insert(run.force.end(), c.force[0].begin(), c.force[0].end());
    ++blocks;
  };
  ForceCompensation compensation(parameters, false, outputs);
  for (std::size_t axis = 0; axis < 3; ++axis) compensation.setSensor(axis, ReferenceCase::exactSensor());
  for (std::size_t at = 0; at + BLOCK <= record.time.size(); at += BLOCK) {
    compensation.handle(SpindleAngle{record.time[at], 0.0, units::radPerSecFromRpm(21750.0)});
    SampleBlock block = forceBlock(record.time[at], RATE, 1000 + at);
    for (std::size_t i = at; i < at + BLOCK; ++i)
      block.samples.insert(block.samples.end(), {record.measured[0][i], record.measured[1][i], 0.0});
    compensation.handle(block);
  }
  run.before_end = blocks;
  compensation.flush();
  return run;
}

// In the class that the node runs: sample index and stamp stay, blocks come the stated lag later, and the
// error falls.
TEST(FixedLag, KeepsTheIndexAndLowersTheError) {
  ReferenceCase reference;
  reference.spindle_speed = units::radPerSecFromRpm(21750.0);
  reference.duration = 0.5;
  const ReferenceRecord record = simulate(reference);
  const Outcome causal = runOf(record, 0.0), lagged = runOf(record, 0.04);
  ASSERT_EQ(lagged.force.size(), causal.force.size());
  EXPECT_EQ(causal.before_end, 50u);
  EXPECT_EQ(lagged.before_end, 46u);  // 40 ms are 4 blocks
  const auto error = [&](const std::vector<double>& force) {
    return bandError(force, record.truth[0], RATE, 3072, force.size(), 5000.0);
  };
  EXPECT_LT(error(causal.force), 0.012);
  EXPECT_LT(error(lagged.force), 0.95 * error(causal.force));
  // The backward pass stops at the entry of the tool: before it (less the detection delay) the force is noise
  // of the causal filter's size.
  for (std::size_t i = 256; i + 40 < 512; ++i) EXPECT_LT(std::abs(lagged.force[i]), 6.0) << i;
}

TEST(FixedLag, AGapPublishesPendingBlocks) {
  ReferenceCase reference;
  reference.spindle_speed = units::radPerSecFromRpm(21750.0);
  reference.duration = 0.1;
  const ReferenceRecord record = simulate(reference);
  CompensationParameters parameters;
  parameters.lag = 1.0;
  std::vector<std::uint64_t> out;
  ForceCompensation compensation(parameters, false,
                                 {{}, [&](const ForceBlock& c) { out.push_back(c.first_index); }});
  for (std::size_t axis = 0; axis < 3; ++axis) compensation.setSensor(axis, ReferenceCase::exactSensor());
  const auto feed = [&](std::uint64_t index) {
    compensation.handle(SpindleAngle{static_cast<double>(index) / RATE, 0.0, reference.spindle_speed});
    SampleBlock block = forceBlock(static_cast<double>(index) / RATE, RATE, index);
    block.samples.assign(3 * 256, 1.0);
    compensation.handle(block);
  };
  feed(0);
  feed(256);
  EXPECT_TRUE(out.empty());
  feed(1024);  // a gap
  EXPECT_EQ(out, (std::vector<std::uint64_t>{0, 256}));
  compensation.flush();
  EXPECT_EQ(out, (std::vector<std::uint64_t>{0, 256, 1024}));
}

TEST(FixedLag, RefusesANegativeLag) {
  CompensationParameters parameters;
  parameters.lag = -0.1;
  EXPECT_THROW(parameters.validate(), Error);
}

}  // namespace
}  // namespace smartmill::kalman
