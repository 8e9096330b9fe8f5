#include "smartmill_stability/chatter/chatter_detector.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <random>
#include <type_traits>
#include <vector>

#include <gtest/gtest.h>

#include "smartmill_core/cutting/mechanistic.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability_testing/cutting_scene.h"

namespace smartmill::stability {
namespace {

using units::TWO_PI;

/// Verdicts of the detector on a scene.
std::vector<ChatterState> run(const Scene& scene, const ChatterParameters& parameters = {}) {
  std::vector<ChatterState> states;
  ChatterDetector detector(parameters, [&](const ChatterState& state) { states.push_back(state); });
  play(scene, [&](const auto& input) { detector.handle(input); });
  return states;
}

TEST(ChatterDetector, forcedVibrationIsNoChatter) {
  const std::vector<ChatterState> states = run({});
  int valid = 0;
  for (const ChatterState& state : states) {
    EXPECT_FALSE(state.chatter) << state.stamp;
    if (!state.valid) continue;
    ++valid;
    // The remainder is the noise, 1 N in each of three axes; resampling removes at most 36 % of the power of
    // white noise.
    EXPECT_LT(state.severity, 1.03 * std::sqrt(3.0)) << state.stamp;
    EXPECT_GT(state.severity, 0.8 * std::sqrt(3.0)) << state.stamp;
    EXPECT_EQ(state.condition, "cut_1");
    EXPECT_GT(state.stamp, 0.5);
    EXPECT_LT(state.stamp, 2.52);
  }
  // Two seconds at 75.3 revolutions per second, a verdict every 8 revolutions, the first after 20.
  EXPECT_NEAR(valid, (2.0 * 75.3 - 20.0) / 8.0, 2.0);
}

TEST(ChatterDetector, measuresFrequencyAndForceOfChatter) {
  Scene scene;
  scene.chatter = 120.0;
  int valid = 0;
  for (const ChatterState& state : run(scene)) {
    if (!state.valid) continue;
    ++valid;
    EXPECT_TRUE(state.chatter);
    EXPECT_NEAR(state.frequency, scene.frequency, 0.5) << state.stamp;
    // Amplitude over sqrt(2), plus noise; the mean over the revolutions removes up to a few percent.
    EXPECT_NEAR(state.severity, 120.0 / std::sqrt(2.0), 6.0) << state.stamp;
    // Total energy: forced vibration in x and in y (amplitude times 0.7), and chatter.
    const double forced = 1.49 * (150.0 * 150.0 + 60.0 * 60.0 + 40.0 * 40.0) / 2.0,
                 chatter = 120.0 * 120.0 / 2.0;
    EXPECT_NEAR(state.energy_ratio, chatter / (forced + chatter), 0.03) << state.stamp;
  }
  EXPECT_GT(valid, 10);
}

TEST(ChatterDetector, detectsTheOnsetOfChatter) {
  Scene scene;
  scene.chatter = 150.0;
  scene.chatter_from = 1.5;
  bool before = false;
  double first = 0.0;
  for (const ChatterState& state : run(scene)) {
    if (state.chatter && first == 0.0) first = state.stamp;
    before = before || (state.chatter && state.stamp < 1.5);
  }
  EXPECT_FALSE(before);
  EXPECT_GT(first, 1.5);
  EXPECT_LT(first, 1.5 + 24 / 75.3);  // at most one window and one hop later
}

// Every other tooth leaves the cut: synchronous with the revolution, distinguished from runout by its
// amplitude.
TEST(ChatterDetector, detectsTheFlipOfFourTeeth) {
  Scene scene;
  scene.teeth = 4;
  scene.alternating = 150.0;
  int valid = 0;
  for (const ChatterState& state : run(scene)) {
    if (!state.valid) continue;
    ++valid;
    EXPECT_TRUE(state.chatter);
    EXPECT_NEAR(state.frequency, 2.0 * 75.3, 0.1);
    const double forced = 1.49 * (150.0 * 150.0 + 60.0 * 60.0 + 40.0 * 40.0) / 2.0,
                 flip = 150.0 * 150.0 / 2.0;
    EXPECT_NEAR(state.alternation, flip / (forced + flip), 0.02);
    EXPECT_NEAR(state.severity, 150.0 / std::sqrt(2.0), 5.0);
  }
  EXPECT_GT(valid, 10);
  // Alternation of a tenth of the force, typical of runout, is no chatter. With an unknown number of teeth a
  // flip is not detected.
  scene.alternating = 20.0;
  for (const ChatterState& state : run(scene)) EXPECT_FALSE(state.chatter);
  scene.alternating = 150.0;
  scene.teeth = 0;
  for (const ChatterState& state : run(scene)) EXPECT_FALSE(state.chatter);
}

// The transient of an entry is no chatter, although it is large in the first window.
TEST(ChatterDetector, aDecayingTransientIsNoChatter) {
  Scene scene;
  scene.transient = 400.0;
  double largest = 0.0;
  for (const ChatterState& state : run(scene)) {
    EXPECT_FALSE(state.chatter) << state.stamp;
    largest = std::max(largest, state.energy_ratio);
  }
  EXPECT_GT(largest, 0.1);  // above energy_ratio
}

/// Verdicts without a spindle angle.
std::vector<ChatterState> runWithoutAngle(const Scene& scene) {
  ChatterParameters parameters;
  parameters.angle = "none";
  parameters.harmonics_window = 0.8;
  std::vector<ChatterState> states;
  ChatterDetector detector(parameters, [&](const ChatterState& state) { states.push_back(state); });
  play(scene, [&](const auto& input) {
    if constexpr (!std::is_same_v<std::decay_t<decltype(input)>, SpindleAngle>) detector.handle(input);
  });
  return states;
}

TEST(ChatterDetector, withoutAnAngleTheHarmonicsDecide) {
  Scene scene;
  scene.teeth = 4;
  scene.chatter = 120.0;
  int chattering = 0, stable = 0;
  for (const ChatterState& state : runWithoutAngle(scene)) {
    if (!state.valid) continue;
    ++chattering;
    EXPECT_TRUE(state.chatter);
    EXPECT_NEAR(state.frequency, scene.frequency, 1.0) << state.stamp;
    EXPECT_NEAR(state.severity, 120.0 / std::sqrt(2.0), 12.0) << state.stamp;
    EXPECT_EQ(state.condition, "cut_1");
  }
  scene.chatter = 0.0;
  for (const ChatterState& state : runWithoutAngle(scene)) {
    EXPECT_FALSE(state.chatter) << state.stamp;
    stable += state.valid;
  }
  // Two seconds less 4 revolutions of settling, windows of 0.8 s by half.
  EXPECT_GE(chattering, 2);
  EXPECT_GE(stable, 2);
}

// Around a circle of 10 mm at 20 mm/s: the force of the teeth turns with the feed, with and without chatter.
TEST(ChatterDetector, aTurningFeedIsNoChatter) {
  constexpr double RATE = 10000.0, RADIUS = 10e-3, FEED = 20e-3;
  const double speed = units::radPerSecFromRpm(4500.0);
  ToolGeometry tool;
  tool.teeth = 3;
  tool.diameter = 16e-3;
  tool.helix = 0.5;
  const MechanisticForce cut(tool, {800e6, 250e6, 100e6, 20e3, 20e3, 1e3}, {1.5, units::PI, 3e-3, 0.1e-3});
  for (const double sense : {1.0, -1.0}) {
    for (const double chatter : {0.0, 120.0}) {
      std::vector<ChatterState> verdicts;
      ChatterDetector detector(ChatterParameters(), [&](const ChatterState& state) {
        if (state.valid) verdicts.push_back(state);
      });
      CuttingCondition condition;
      condition.kind = CuttingCondition::Kind::cut;
      condition.name = "ring";
      condition.tool = tool;
      condition.steady_to = {NOT_A_NUMBER, NOT_A_NUMBER, NOT_A_NUMBER};
      detector.handle(condition);
      ForceBlock block;
      block.sample_rate = RATE;
      for (int k = 0; k < 15000; ++k) {
        const double time = k / RATE, turned = sense * FEED / RADIUS * time;  // of the feed from +x
        const CuttingForce force = cut.at(speed * time + turned);
        const std::complex<double> in_machine =
            std::complex<double>(force.fx, force.fy) * std::polar(1.0, turned) +
            chatter * std::sin(units::TWO_PI * 1107.0 * time);
        block.force[0].push_back(in_machine.real());
        block.force[1].push_back(in_machine.imag());
        block.force[2].push_back(force.fz);
        if (k % 50 == 0) detector.handle(SpindleAngle{time, std::fmod(speed * time, units::TWO_PI), speed});
        if (k % 200 == 0) {
          CncState state;
          state.stamp = time;
          state.connected = true;
          state.axes = {"X", "Y", "Z"};
          state.position = {RADIUS * std::sin(sense * turned), sense * RADIUS * (1.0 - std::cos(turned)),
                            0.0};
          state.feed = FEED;
          detector.handle(state);
        }
        if (block.force[0].size() < 100) continue;
        detector.handle(block);
        block.first_index += 100;
        block.stamp = (k + 1) / RATE;
        for (auto& axis : block.force) axis.clear();
      }
      ASSERT_GT(verdicts.size(), 5u);
      for (const ChatterState& verdict : verdicts) {
        EXPECT_EQ(verdict.chatter, chatter > 0.0) << verdict.energy_ratio;
        if (chatter == 0.0) {
          EXPECT_LT(verdict.energy_ratio, 0.005);
        }
      }
    }
  }
}

/// Verdicts on corners of a pocket, one each second: the entry angle goes from that of a line (radial depth
/// of 7 % of the diameter) to half immersion and back, with runout of 5 um.
/// @param chatter [N] amplitude of 1187 Hz, 0.83 orders above a tooth passing harmonic
std::vector<ChatterState> corners(double chatter, const ToolGeometry& stated) {
  constexpr double RATE = 10000.0, LINE = 2.6, RUNOUT = 5e-6;
  constexpr int STEPS = 200;  // of the engagement
  const double speed = units::radPerSecFromRpm(4500.0);
  ToolGeometry tool;
  tool.teeth = 3;
  tool.diameter = 16e-3;
  tool.helix = 0.5;
  const CuttingCoefficients coefficients{800e6, 250e6, 100e6, 20e3, 20e3, 1e3};
  std::vector<MechanisticForce> cuts;
  for (int k = 0; k <= STEPS; ++k) {
    const double entry = LINE + (0.5 * units::PI - LINE) * k / STEPS;
    cuts.emplace_back(tool, coefficients, Engagement{entry, units::PI, 3e-3, 0.1e-3});
  }
  std::vector<ChatterState> states;
  ChatterDetector detector(ChatterParameters(), [&](const ChatterState& state) { states.push_back(state); });
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::unsteady;
  condition.name = "corner";
  condition.tool = stated;
  condition.steady_from = condition.steady_to = {NOT_A_NUMBER, NOT_A_NUMBER, NOT_A_NUMBER};
  detector.handle(condition);
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 1.0);
  ForceBlock block;
  block.sample_rate = RATE;
  for (int k = 0; k < 30000; ++k) {
    const double time = k / RATE, angle = speed * time;
    const auto step = static_cast<std::size_t>(STEPS * (0.5 - 0.5 * std::cos(units::TWO_PI * time)));
    // The chip of a tooth off centre differs by up to RUNOUT over the feed per tooth.
    const double chip = 1.0 + RUNOUT / 0.1e-3 * std::cos(angle);
    const CuttingForce force = cuts[step].at(angle);
    block.force[0].push_back(chip * force.fx + chatter * std::sin(units::TWO_PI * 1187.0 * time) +
                             noise(random));
    block.force[1].push_back(chip * force.fy + noise(random));
    block.force[2].push_back(chip * force.fz + noise(random));
    if (k % 50 == 0) detector.handle(SpindleAngle{time, std::fmod(angle, units::TWO_PI), speed});
    if (k % 200 == 0) {
      CncState state;
      state.stamp = time;
      state.connected = true;
      state.feed = 20e-3;
      detector.handle(state);
    }
    if (block.force[0].size() < 100) continue;
    detector.handle(block);
    block.first_index += 100;
    block.stamp = (k + 1) / RATE;
    for (auto& axis : block.force) axis.clear();
  }
  return states;
}

TEST(ChatterDetector, judgesUnsteadyCuts) {
  ToolGeometry tool;
  tool.teeth = 3;
  for (const double chatter : {0.0, 100.0}) {
    int valid = 0;
    for (const ChatterState& state : corners(chatter, tool)) {
      if (!state.valid) continue;
      ++valid;
      EXPECT_EQ(state.chatter, chatter > 0.0) << state.stamp << ' ' << state.energy_ratio;
      EXPECT_EQ(state.condition, "corner");
      if (chatter > 0.0) {
        EXPECT_NEAR(state.frequency, 1187.0, 1.0) << state.stamp;
        // The noise adds 2 N at most, the forced vibration is removed to a few percent of its change.
        EXPECT_NEAR(state.severity, 100.0 / std::sqrt(2.0), 7.0) << state.stamp;
      }
    }
    EXPECT_GT(valid, 20);
  }
}

// The forced vibration of one tooth, of an unknown number of teeth or of an uneven pitch repeats with the
// revolution only: its change and chatter have the same frequencies.
TEST(ChatterDetector, judgesNoUnsteadyCutOfOneToothOrAnUnevenPitch) {
  ToolGeometry unknown, one, uneven;
  unknown.teeth = 0;
  one.teeth = 1;
  uneven.teeth = 3;
  uneven.pitch = {2.0, 2.1, units::TWO_PI - 4.1};
  for (const ToolGeometry& tool : {unknown, one, uneven})
    for (const ChatterState& state : corners(100.0, tool)) EXPECT_FALSE(state.valid);
}

TEST(SignalBlock, hasUpToThreeChannels) {
  SampleBlock block;
  block.stamp = 3.0;
  block.sample_rate = 1000.0;
  block.first_index = 7;
  block.channels = {"ax", "ay"};
  block.units = {"m/s2", "m/s2"};
  block.samples = {1.0, 2.0, 3.0, 4.0};
  const ForceBlock signal = signalBlock(block);
  EXPECT_EQ(signal.stamp, 3.0);
  EXPECT_EQ(signal.first_index, 7u);
  EXPECT_EQ(signal.force[0], (std::vector<double>{1.0, 3.0}));
  EXPECT_EQ(signal.force[1], (std::vector<double>{2.0, 4.0}));
  EXPECT_EQ(signal.force[2], (std::vector<double>{0.0, 0.0}));
  EXPECT_THROW(signalBlock(SampleBlock{}), Error);
}

TEST(ChatterDetector, isInvalidOutsideTheSteadyCut) {
  const std::vector<ChatterState> states = run({});
  ASSERT_FALSE(states.empty());
  EXPECT_FALSE(states.front().valid);
  EXPECT_TRUE(std::isnan(states.front().frequency));
  EXPECT_FALSE(states.back().valid);
  EXPECT_NEAR(states.back().stamp, 2.5, 0.03);
}

// The verdicts do not depend on the delay between streams, and are the same after a restart of the bag.
TEST(DetectionPipeline, verdictsDoNotDependOnTheOrderOfArrival) {
  const auto feed = [](DetectionPipeline& detection, double lag) {
    CuttingCondition condition;
    condition.stamp = 0.01;
    condition.kind = CuttingCondition::Kind::cut;
    condition.name = "cut";
    condition.steady_from = {{0.0, 0.0, 0.0}};
    condition.steady_to = {{1.0, 0.0, 0.0}};
    detection.push(condition);
    std::vector<ForceBlock> late;
    for (int b = 0; b < 150; ++b) {
      const double t = 0.01 * b;
      CncState state;
      state.stamp = t;
      state.connected = true;
      state.axes = {"X", "Y", "Z"};
      state.position = {0.02 * t + 0.001, 0.0, 0.0};
      state.feed = 0.02;
      ForceBlock block;
      block.stamp = t;
      block.sample_rate = RATE;
      block.first_index = static_cast<std::uint64_t>(b) * BLOCK;
      for (int i = 0; i < BLOCK; ++i) {
        const double at = t + i / RATE;
        block.force[0].push_back(50.0 * std::cos(TWO_PI * 733.0 * at) + 80.0 * std::cos(SPEED * at));
      }
      block.force[1] = block.force[2] = block.force[0];
      late.push_back(block);
      detection.push(state);
      detection.push(SpindleAngle{t, std::fmod(SPEED * t, TWO_PI), SPEED});
      while (!late.empty() && late.front().stamp <= t - lag) {
        detection.push(late.front());
        late.erase(late.begin());
      }
    }
    for (const ForceBlock& block : late) detection.push(block);
    detection.flush();
  };
  std::vector<std::vector<ChatterState>> results;
  std::vector<ChatterState> states;
  DetectionPipeline detection({}, 0.05, [&](const ChatterState& state) {
    if (state.valid) states.push_back(state);
  });
  for (const double lag : {0.0, 0.0, 0.3}) {
    feed(detection, lag);  // from the second call on the stamps jump back: a restart
    results.push_back(states);
    states.clear();
  }
  ASSERT_GT(results[0].size(), 4u);
  for (const auto& result : results) {
    ASSERT_EQ(result.size(), results[0].size());
    for (std::size_t i = 0; i < result.size(); ++i) {
      EXPECT_EQ(result[i].stamp, results[0][i].stamp);
      EXPECT_EQ(result[i].severity, results[0][i].severity);
      EXPECT_EQ(result[i].chatter, results[0][i].chatter);
    }
  }
  EXPECT_TRUE(results[0].back().chatter);
}

// The condition that is valid at the start of a recording may be recorded after the first states.
TEST(DetectionPipeline, theFirstConditionMayArriveLate) {
  const auto verdicts = [](int before) {
    std::vector<ChatterState> states;
    DetectionPipeline detection({}, 0.05, [&](const ChatterState& state) { states.push_back(state); });
    for (int b = 0; b < 100; ++b) {
      if (b == before) {
        CuttingCondition condition;
        condition.stamp = -0.5;
        detection.push(condition);
      }
      const double t = 0.01 * b;
      CncState state;
      state.stamp = t;
      state.connected = true;
      state.axes = {"X", "Y", "Z"};
      state.position = {0.0, 0.0, 0.0};
      ForceBlock block;
      block.stamp = t;
      block.sample_rate = RATE;
      block.first_index = static_cast<std::uint64_t>(b) * BLOCK;
      for (auto& axis : block.force) axis.assign(BLOCK, 0.0);
      detection.push(state);
      detection.push(SpindleAngle{t, 0.0, 0.0});
      detection.push(block);
    }
    detection.flush();
    return states;
  };
  for (const int before : {0, 60}) {
    const std::vector<ChatterState> states = verdicts(before);
    ASSERT_EQ(states.size(), 1u) << before;
    EXPECT_EQ(states[0].stamp, -0.5);
    EXPECT_FALSE(states[0].valid);
  }
}

TEST(ChatterDetector, refusesInvalidParameters) {
  ChatterParameters parameters;
  parameters.energy_ratio = 0.0;
  EXPECT_THROW(ChatterDetector(parameters, [](const ChatterState&) {}), Error);
  parameters = {};
  parameters.hop_revolutions = 17;
  EXPECT_THROW(ChatterDetector(parameters, [](const ChatterState&) {}), Error);
}

}  // namespace
}  // namespace smartmill::stability
