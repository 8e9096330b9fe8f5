#include "smartmill_kalman/compensation/compensation_pipeline.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/testing/force_block.h"
#include "smartmill_core/testing/tap_rig.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

constexpr double RATE = 25600.0;    // [Hz]
constexpr std::size_t BLOCK = 256;  // samples
constexpr double START = 1.75e9;    // [s]

/// Without its samples. @param start [s] of block 0
SampleBlock blockAt(double start, std::size_t number) {
  const std::uint64_t index = number * BLOCK;
  return forceBlock(start + static_cast<double>(index) / RATE, RATE, index);
}

struct Session {
  std::vector<SampleBlock> blocks;
  std::vector<SpindleAngle> angles;
  CuttingCondition condition;
  std::vector<double> truth_x;
};

// A slot at 9000 rpm through a noisy dynamometer.
Session session(std::size_t blocks) {
  const double speed = units::radPerSecFromRpm(9000.0);
  const MechanisticForce process({4, 19.05e-3, units::radFromDeg(30.0), {}},
                                 {796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3}, {0.0, units::PI, 2e-3, 6e-5});
  std::vector<ModalFilter> filters(3, ModalFilter(dynamometer(), RATE, Hold::first_order));
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 1.0);
  Session result;
  result.condition.stamp = START;
  result.condition.kind = CuttingCondition::Kind::cut;
  for (std::size_t b = 0; b < blocks; ++b) {
    SampleBlock block = blockAt(START, b);
    for (std::size_t i = 0; i < BLOCK; ++i) {
      const CuttingForce force = process.at(speed * static_cast<double>(block.first_index + i) / RATE);
      result.truth_x.push_back(force.fx);
      block.samples.push_back(filters[0].step(force.fx) + noise(random));
      block.samples.push_back(filters[1].step(force.fy) + noise(random));
      block.samples.push_back(filters[2].step(force.fz) + noise(random));
    }
    result.blocks.push_back(block);
    result.angles.push_back({block.stamp,
                             std::fmod(speed * static_cast<double>(block.first_index) / RATE, units::TWO_PI),
                             speed});
  }
  return result;
}

ForceSensor forceSensor(bool workpiece) {
  ForceSensor result;
  result.axis.fill(dynamometer());
  result.measures_workpiece = workpiece;
  return result;
}

struct Collected {
  std::vector<ForceBlock> measured, compensated;
};

class Runner {
 public:
  explicit Runner(bool workpiece = false)
      : pipeline({}, {}, forceSensor(workpiece), 0.05,
                 {{[this](const ForceBlock& block) { result.measured.push_back(block); },
                   [this](const ForceBlock& block) { result.compensated.push_back(block); }}}) {}
  void feed(const Session& s) {
    pipeline.push(s.condition);
    for (std::size_t b = 0; b < s.blocks.size(); ++b) {
      pipeline.push(s.angles[b]);
      pipeline.push(s.blocks[b]);
    }
    pipeline.flush();
  }
  Collected result;
  CompensationPipeline pipeline;
};

TEST(ForceCompensation, keepsTheSampleIndexAndFindsTheForce) {
  const Session s = session(60);
  Runner runner;
  runner.feed(s);
  ASSERT_EQ(runner.result.compensated.size(), 60u);
  double error = 0.0, norm = 0.0;
  for (std::size_t b = 0; b < 60; ++b) {
    const ForceBlock& block = runner.result.compensated[b];
    EXPECT_EQ(block.first_index, b * BLOCK);
    EXPECT_EQ(block.stamp, s.blocks[b].stamp);
    if (b < 40) continue;
    EXPECT_EQ(block.status, ForceBlock::Status::compensated);
    for (std::size_t i = 0; i < BLOCK; ++i) {
      const double truth = s.truth_x[b * BLOCK + i];
      error += std::pow(block.force[0][i] - truth, 2);
      norm += truth * truth;
    }
  }
  EXPECT_LT(std::sqrt(error / norm), 0.10);
  EXPECT_EQ(runner.result.compensated.front().status, ForceBlock::Status::settling);
}

// The tool leaves the stock over five revolutions: the force falls faster than the filter follows. Every
// block whose error is above half of the force is marked; in the steady cut before none is.
TEST(ForceCompensation, marksAForceThatFallsFasterThanTheFilterFollows) {
  constexpr std::size_t STEADY = 60, FALL = 8;
  Session s = session(STEADY + FALL + 4);
  std::vector<ModalFilter> filters(3, ModalFilter(dynamometer(), RATE, Hold::first_order));
  std::mt19937 random(6);
  std::normal_distribution<double> noise(0.0, 1.0);
  const double speed = units::radPerSecFromRpm(9000.0);
  const MechanisticForce process({4, 19.05e-3, units::radFromDeg(30.0), {}},
                                 {796e6, 168e6, 222e6, 27.7e3, 30.8e3, 1.4e3}, {0.0, units::PI, 2e-3, 6e-5});
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    for (std::size_t i = 0; i < BLOCK; ++i) {
      const double blocks = static_cast<double>(b) + static_cast<double>(i) / static_cast<double>(BLOCK);
      const double share =
          std::clamp((static_cast<double>(STEADY + FALL) - blocks) / static_cast<double>(FALL), 0.0, 1.0);
      const CuttingForce force = process.at(speed * static_cast<double>(s.blocks[b].first_index + i) / RATE);
      s.truth_x[b * BLOCK + i] = share * force.fx;
      s.blocks[b].samples[3 * i] = filters[0].step(share * force.fx) + noise(random);
      s.blocks[b].samples[3 * i + 1] = filters[1].step(share * force.fy) + noise(random);
      s.blocks[b].samples[3 * i + 2] = filters[2].step(share * force.fz) + noise(random);
    }
  }
  Runner runner;
  runner.feed(s);
  std::size_t marked = 0;
  double steady_norm = 0.0;  // [N2] of a block
  for (std::size_t b = 40; b < STEADY + FALL; ++b) {
    const ForceBlock& block = runner.result.compensated[b];
    double error = 0.0, norm = 0.0;
    for (std::size_t i = 0; i < BLOCK; ++i) {
      error += std::pow(block.force[0][i] - s.truth_x[b * BLOCK + i], 2);
      norm += std::pow(s.truth_x[b * BLOCK + i], 2);
    }
    const bool transient = block.status == ForceBlock::Status::transient;
    marked += transient ? 1 : 0;
    EXPECT_TRUE(block.isCompensated());
    EXPECT_FALSE(transient && b < STEADY) << "block " << b;
    steady_norm = b < STEADY ? norm : steady_norm;
    // Of less than a fifth of the force the share says nothing.
    EXPECT_TRUE(transient || error < 0.25 * norm || norm < 0.04 * steady_norm) << "block " << b;
  }
  EXPECT_GT(marked, 0u);
}

TEST(ForceCompensation, doesNotDependOnTheOrderOfArrival) {
  const Session s = session(40);
  Runner straight;
  straight.feed(s);
  Runner mixed;
  mixed.pipeline.push(s.angles[0]);
  mixed.pipeline.push(s.condition);
  for (std::size_t b = 0; b < s.blocks.size(); b += 4) {  // angles three blocks late
    for (std::size_t i = b; i < b + 4; ++i) mixed.pipeline.push(s.blocks[i]);
    for (std::size_t i = b; i < b + 4; ++i) {
      if (i > 0) mixed.pipeline.push(s.angles[i]);
    }
  }
  mixed.pipeline.flush();
  ASSERT_EQ(mixed.result.compensated.size(), straight.result.compensated.size());
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    EXPECT_EQ(mixed.result.compensated[b].force, straight.result.compensated[b].force) << "block " << b;
  }
}

TEST(ForceCompensation, restartsAtAGapAndMarksIt) {
  const Session s = session(60);
  Runner runner;
  Session gapped = s;
  gapped.blocks.erase(gapped.blocks.begin() + 50);
  gapped.angles.erase(gapped.angles.begin() + 50);
  runner.feed(gapped);
  EXPECT_EQ(runner.pipeline.forces().health().gaps, 1u);
  EXPECT_EQ(runner.result.compensated[49].status, ForceBlock::Status::compensated);
  EXPECT_EQ(runner.result.compensated[50].status, ForceBlock::Status::settling);
}

// A spindle that gains 4 % in 2 s: the harmonics follow it, the gains change at the points of their grid.
TEST(ForceCompensation, followsASlowChangeOfSpeedWithoutAJump) {
  const ModalModel model = dynamometer();
  ModalFilter dynamometer(model, 4.0 * RATE, Hold::first_order);
  std::vector<double> truth, found;
  ForceCompensation compensation(
      {}, false,
      {{}, [&](const ForceBlock& c) { found.insert(found.end(), c.force[0].begin(), c.force[0].end()); }});
  for (std::size_t axis = 0; axis < 3; ++axis) compensation.setSensor(axis, model);
  double angle = 0.0;
  for (std::size_t b = 0; b < 200; ++b) {
    const auto speedAt = [](double t) { return 900.0 * (1.0 + 0.02 * t); };
    SampleBlock block = blockAt(0.0, b);
    compensation.handle(SpindleAngle{block.stamp, std::fmod(angle, units::TWO_PI), speedAt(block.stamp)});
    for (std::size_t i = 0; i < 256; ++i) {
      double measured = 0.0, force = 0.0;
      for (int fine = 1; fine <= 4; ++fine) {
        angle += speedAt(block.timeOf(i)) / (4.0 * RATE);
        force = 60.0 + 100.0 * std::cos(4.0 * angle) + 30.0 * std::sin(angle) +
                20.0 * std::cos(8.0 * angle + 1.0);
        measured = dynamometer.step(force);
      }
      truth.push_back(force);
      block.samples.insert(block.samples.end(), {measured, 0.0, 0.0});
    }
    compensation.handle(block);
  }
  double worst = 0.0;
  for (std::size_t i = 12800; i < truth.size(); ++i) worst = std::max(worst, std::abs(found[i] - truth[i]));
  // 0.02 % of speed a block is 0.1 % of a revolution of the eighth harmonic a turn.
  EXPECT_LT(worst, 2.0);
}

TEST(ForceCompensation, estimatesTheZeroOfTheSensorAndTheCorrelationOfTheInnovations) {
  ForceCompensation compensation({}, false, {});
  for (std::size_t axis = 0; axis < 3; ++axis) compensation.setSensor(axis, dynamometer());
  std::mt19937 random(4);
  std::normal_distribution<double> noise;
  CuttingCondition air;
  air.kind = CuttingCondition::Kind::air;
  compensation.handle(air);
  const auto feed = [&](std::size_t from, double correlation) {
    double last = 0.0;
    for (std::size_t b = from; b < from + 1000; ++b) {
      SampleBlock block = blockAt(0.0, b);
      compensation.handle(SpindleAngle{block.stamp, 0.0, 1200.0});
      for (std::size_t i = 0; i < 256; ++i) {
        last = correlation * last + std::sqrt(1.0 - correlation * correlation) * noise(random);
        block.samples.insert(block.samples.end(), {5.0 + last, -2.0 + noise(random), noise(random)});
      }
      compensation.handle(block);
    }
  };
  feed(0, 0.0);
  // Mean over 2 s of 1 N noise: 5 mN; the zero comes in with that time constant, 10 s of it.
  EXPECT_NEAR(compensation.health().zero[0], 5.0, 0.05);
  EXPECT_NEAR(compensation.health().zero[1], -2.0, 0.05);
  EXPECT_LT(compensation.health().innovation_correlation,
            0.3);  // 1 / sqrt(256) a block, and what the filter takes out
  EXPECT_NEAR(compensation.health().innovation_ratio, 1.0, 0.2);
  feed(1000, 0.9);
  EXPECT_GT(compensation.health().innovation_correlation, 0.5);
  const std::array<double, 3> zero = compensation.health().zero;
  CuttingCondition unsteady;
  unsteady.kind = CuttingCondition::Kind::unsteady;
  compensation.handle(unsteady);
  feed(2000, 0.0);
  EXPECT_EQ(compensation.health().zero, zero);
}

TEST(ForceCompensation, bridgesSamplesThatAreNotNumbers) {
  Session s = session(60);
  for (std::size_t i = 0; i < 5; ++i) s.blocks[50].samples[3 * (100 + i)] = NAN;
  Runner runner;
  runner.feed(s);
  EXPECT_EQ(runner.pipeline.forces().health().not_finite, 5u);
  for (const ForceBlock& block : runner.result.compensated) {
    for (const double force : block.force[0]) ASSERT_TRUE(std::isfinite(force));
  }
  for (std::size_t i = 0; i < 5; ++i) {
    const double truth = s.truth_x[50 * BLOCK + 100 + i];
    const double largest = *std::max_element(s.truth_x.begin(), s.truth_x.end());
    EXPECT_NEAR(runner.result.compensated[50].force[0][100 + i], truth, 0.2 * std::abs(largest) + 10.0);
  }
}

// Status compensated means that the dynamics of the sensor are removed.
TEST(ForceCompensation, passesThroughUntilTheSensorIsKnown) {
  const ForceSensor ideal;
  const Session s = session(4);
  std::vector<ForceBlock> compensated;
  ForceCompensation compensation(CompensationParameters(), false,
                                 {{}, [&](const ForceBlock& block) { compensated.push_back(block); }});
  for (std::size_t axis = 0; axis < 3; ++axis) compensation.setSensor(axis, ideal.axis[axis]);
  EXPECT_FALSE(compensation.hasDynamics());
  compensation.handle(s.angles.front());
  compensation.handle(s.blocks.front());
  ModalModel tapped = ideal.axis[1];
  tapped.direct = 0.1;
  tapped.modes = {{1080.0, 0.025, 0.9}};
  compensation.setSensor(1, tapped);
  EXPECT_TRUE(compensation.hasDynamics());
  compensation.handle(s.blocks.at(1));
  ASSERT_EQ(compensated.size(), 2u);
  EXPECT_EQ(compensated[0].status, ForceBlock::Status::passed_through);
  EXPECT_EQ(compensated[0].force[0][10], s.blocks[0].at(10, 0));
  EXPECT_EQ(compensated[1].status, ForceBlock::Status::settling);
}

TEST(ForceCompensation, passesThroughAtRestAndTurnsTheReaction) {
  Session s = session(4);
  for (SpindleAngle& angle : s.angles) angle.speed = 0.0;
  Runner runner(true);
  runner.feed(s);
  for (const ForceBlock& block : runner.result.compensated) {
    EXPECT_EQ(block.status, ForceBlock::Status::passed_through);
  }
  EXPECT_EQ(runner.result.measured[0].force[0][10], -s.blocks[0].at(10, 0));
}

TEST(ForceCompensation, refusesBlocksWithoutForces) {
  ForceCompensation compensation({}, false, {});
  SampleBlock block;
  block.channels = {"hammer"};
  block.units = {"N"};
  block.sample_rate = RATE;
  block.samples = {1.0};
  EXPECT_THROW(compensation.handle(block), Error);
}

// The block is refused when it arrives, not when an angle releases it from the sorter.
TEST(CompensationPipeline, RefusesABadBlockAtItsOwnPush) {
  Session s = session(20);
  s.blocks[10].units[1] = "V";
  Runner runner;
  runner.pipeline.push(s.condition);
  for (std::size_t b = 0; b < 20; ++b) {
    if (b == 10) {
      EXPECT_THROW(runner.pipeline.push(s.blocks[b]), Error);
    } else {
      EXPECT_NO_THROW(runner.pipeline.push(s.blocks[b]));
    }
    EXPECT_NO_THROW(runner.pipeline.push(s.angles[b]));
  }
  runner.pipeline.flush();
  EXPECT_EQ(runner.result.compensated.size(), 19u);
  EXPECT_EQ(runner.pipeline.forces().health().gaps, 1u);
}

// The delay form needs 18 samples a revolution; 90,000 rpm give 17.07 at 25.6 kHz. The input that releases
// the block is not blamed.
TEST(CompensationPipeline, ReportsABlockThatCannotBeCompensated) {
  Session s = session(10);
  for (SpindleAngle& angle : s.angles) angle.speed = units::radPerSecFromRpm(90000.0);
  CompensationParameters parameters;
  parameters.delay_form = true;
  std::vector<std::string> errors;
  CompensationPipeline::Outputs outputs;
  outputs.block_error = [&](const std::string& reason) { errors.push_back(reason); };
  CompensationPipeline pipeline(parameters, {}, forceSensor(false), 0.05, outputs);
  CompensationPipeline strict(parameters, {}, forceSensor(false), 0.0, {});
  bool thrown = false;
  for (std::size_t b = 0; b < 10; ++b) {
    pipeline.push(s.blocks[b]);
    EXPECT_NO_THROW(pipeline.push(s.angles[b]));
    strict.push(s.blocks[b]);
    try {
      strict.push(s.angles[b]);
    } catch (const Error&) {
      thrown = true;
    }
  }
  pipeline.flush();
  EXPECT_EQ(errors.size(), 10u);
  EXPECT_NE(errors.at(0).find("period"), std::string::npos) << errors[0];
  EXPECT_TRUE(thrown);
}

}  // namespace
}  // namespace smartmill::kalman
