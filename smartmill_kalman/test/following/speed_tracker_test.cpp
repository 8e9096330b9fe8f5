#include "smartmill_kalman/following/speed_tracker.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/coverage.h"
#include "smartmill_core/testing/force_block.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/compensation/compensation_pipeline.h"
#include "smartmill_kalman_testing/reference_case.h"

namespace smartmill::kalman {
namespace {

// A phase that the filters never take in (endless memory) and a speed that is off: with the slope known the
// tracker is a textbook Kalman filter, and least squares over the same samples gives the achievable variance:
// a ramp of phase with noise has the variance 12 r / (slope^2 dt^2 N^3), four times that where the phase at
// the start is known.
TEST(SpeedTracker, FindsTheSpeedAsWellAsLeastSquares) {
  constexpr double RATE = 25600.0, SPEED = 900.0, SLOPE = 400.0;
  constexpr int COUNT = 2000, RUNS = Coverage::RUNS;
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 1.0);
  double squares = 0.0;
  Coverage speed;
  for (int run = 0; run < RUNS; ++run) {
    const double truth = SPEED * (1.0 + 0.001 * noise(random));
    SpeedTracker tracker({0.001, 1e-9, 1.0}, SPEED, RATE);
    double phase = 0.0;
    for (int i = 0; i < COUNT; ++i) {
      tracker.update(0, SLOPE * phase + noise(random), SLOPE, 1.0, 0.0);
      tracker.predict(SPEED, 1e9);
      phase += (truth - SPEED) / RATE;
    }
    const double off = tracker.speed() - truth;
    squares += off * off / RUNS;
    speed.add(off, tracker.speedStd());
  }
  // Phase zero at the start: sum of (i dt)^2 is N^3 dt^2 / 3.
  const double best = std::sqrt(3.0) / (SLOPE / RATE * std::pow(COUNT, 1.5));
  EXPECT_LT(std::sqrt(squares), 1.3 * best);  // RMS of 200 runs: +- 5 % and a window of inflated noise
  EXPECT_GT(std::sqrt(squares), 0.7 * best);
  EXPECT_TRUE(speed.isCalibrated());
}

TEST(SpeedTracker, LearnsNothingFromNoise) {
  SpeedTracker tracker({}, 900.0, 25600.0);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (int i = 0; i < 25600; ++i) {
    tracker.update(0, noise(random), 20.0 * noise(random), 1.0, 20.0);
    tracker.predict(900.0, 1e-3);
  }
  EXPECT_EQ(tracker.speed(), 900.0);
  EXPECT_GT(tracker.speedStd(), 0.009 * 900.0);
}

TEST(SpeedTracker, RefusesImpossibleParameters) {
  EXPECT_THROW(SpeedTracker({0.0, 0.05, 0.25}, 900.0, 25600.0), Error);
  EXPECT_THROW(SpeedTracker({}, 0.0, 25600.0), Error);
  CompensationParameters parameters;
  parameters.track_speed = parameters.follow = true;
  EXPECT_THROW(parameters.validate(), Error);
}

struct Outcome {
  double tachometer = 0.0, tracked = 0.0;  // [1] error to 5 kHz
};

/// Error from 0.25 s on, worst of x and y.
Outcome outcome(double rpm, double off, double drop) {
  ReferenceCase reference;
  reference.spindle_speed = units::radPerSecFromRpm(rpm);
  reference.duration = 0.45;
  reference.nominal_off = off;
  reference.speed_drop = drop;
  const ReferenceRecord record = simulate(reference);
  const auto error = [&](bool track) {
    CompensationParameters parameters;
    parameters.track_speed = track;
    parameters.filter.memory_revolutions = 2.0;  // with a longer one the tachometer's lead grows
    const auto force = runCompensation(reference, record, reference.sensor, parameters);
    double worst = 0.0;
    for (std::size_t axis = 0; axis < 2; ++axis)
      worst = std::max(worst,
                       bandError(force[axis], record.truth[axis], 25600.0, 6400, force[axis].size(), 5000.0));
    return worst;
  };
  return {error(false), error(true)};
}

// The causal target of 1.2 % is met without a tachometer, speed unknown within 1 % and falling by 1 %.
TEST(TrackedSpeed, ServesAsWellAsATachometer) {
  for (const double rpm : {9000.0, 21750.0}) {
    for (const double off : {0.01, -0.01}) {
      const Outcome steady = outcome(rpm, off, 0.0);
      EXPECT_LT(steady.tracked, 0.012) << rpm << " " << off;
      EXPECT_LT(steady.tracked, 1.5 * steady.tachometer) << rpm << " " << off;
    }
    const Outcome falling = outcome(rpm, 0.01, 0.01);
    EXPECT_LT(falling.tracked, 0.012) << rpm;
    EXPECT_LT(falling.tracked, 1.5 * falling.tachometer) << rpm;
  }
}

// Without a tachometer there is no stream of angles to wait for: blocks come out as they come in.
TEST(TrackedSpeed, NeedsNoAngles) {
  CompensationParameters parameters;
  parameters.track_speed = true;
  std::size_t out = 0;
  ForceBlock::Status last = ForceBlock::Status::measured;
  ForceSensor sensor;
  sensor.axis[0].direct = 0.98;
  sensor.axis[0].modes = {{4000.0, 0.02, 0.02}};
  CompensationPipeline pipeline(parameters, {}, sensor, 0.05, {{{}, [&](const ForceBlock& c) {
                                                                  ++out;
                                                                  last = c.status;
                                                                }}});
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::cut;
  condition.spindle_speed = units::TWO_PI * 150.0;
  pipeline.push(condition);
  for (std::size_t b = 0; b < 100; ++b) {
    SampleBlock block = forceBlock(0.01 * static_cast<double>(b), 25600.0, 256 * b);
    for (std::size_t i = 0; i < 256; ++i) {
      const double t = block.stamp + static_cast<double>(i) / 25600.0;
      const double force =
          100.0 * std::cos(units::TWO_PI * 150.7 * t) + 300.0 * std::sin(units::TWO_PI * 602.8 * t);
      block.samples.insert(block.samples.end(), {force, 0.5 * force, 0.1 * force});
    }
    pipeline.push(block);
  }
  EXPECT_GT(out, 90u);  // the last 50 ms wait for events
  EXPECT_EQ(last, ForceBlock::Status::compensated);
  EXPECT_NEAR(pipeline.forces().health().speed, units::TWO_PI * 150.7, 0.01);
}

}  // namespace
}  // namespace smartmill::kalman
