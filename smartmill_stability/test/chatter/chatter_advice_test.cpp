#include "smartmill_stability/chatter/chatter_advice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iostream>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_stability_testing/cut_streams.h"
#include "smartmill_stability_testing/oracles.h"
#include "smartmill_stability_testing/time_domain.h"

namespace smartmill::stability {
namespace {

using units::radPerSecFromRpm;

/// The benchmark with 25 times the stiffness: depths of about a millimetre and forces of hundreds of newtons.
ModalModel stiff() {
  ModalModel model = benchmark();
  model.modes[0].gain /= 25.0;
  return model;
}

/// Verdicts of the detector on a simulated cut with runout, noise, a ramp of the depth and an end in air.
struct Study {
  std::vector<ChatterState> states;
  /// [s] Time from which the noiseless force exceeds the energy ratio of the detector in every revolution.
  double grown = NAN;
  /// [Hz] Strongest line of the noiseless force without its synchronous part, over the last 60 revolutions.
  double frequency = NAN;
};

Study cutOnce(const RegenerativeSystem& system, double speed, double depth, unsigned seed) {
  constexpr int STEPS = 720, TURNS = 170, AIR = 10, DECIMATION = 4, LATE = 60;
  TimeDomain run(system, stiff(), stiff(), speed, depth, 0.1e-3, STEPS);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 3.0), runout(0.0, 5e-6);
  std::vector<double> offsets;
  for (int k = 0; k < system.teeth; ++k) offsets.push_back(runout(random));
  run.setRunout(offsets);
  const double turn = units::TWO_PI / speed, rate = STEPS / DECIMATION / turn;
  Study study;
  ChatterDetector detector(ChatterParameters(),
                           [&](const ChatterState& state) { study.states.push_back(state); });
  CutStreams streams(detector, speed, ToolGeometry(), 30.0 * turn);  // full engagement after 30 revolutions
  ForceBlock block;
  block.sample_rate = rate;
  block.status = ForceBlock::Status::compensated;
  std::vector<std::vector<double>> late(2);
  std::vector<std::array<double, 2>> before(STEPS, {{0.0, 0.0}});
  double change = 0.0, all = 0.0;
  for (int i = 0; i < STEPS * (TURNS + AIR); ++i) {
    const double t = turn * i / STEPS;
    const bool cutting = i < STEPS * TURNS;
    if (cutting) run.step();
    const std::array<double, 2> force = cutting ? run.force() : std::array<double, 2>{{0.0, 0.0}};
    // Energy of the change from the previous revolution, and total energy, of each revolution.
    if (i % STEPS == 0) change = all = 0.0;
    auto& old = before[static_cast<std::size_t>(i % STEPS)];
    for (std::size_t a = 0; a < 2; ++a) {
      change += 0.5 * std::pow(force[a] - old[a], 2);
      all += force[a] * force[a];
    }
    if (cutting && i >= STEPS * (TURNS - LATE) && i % DECIMATION == 0)
      for (std::size_t a = 0; a < 2; ++a) late[a].push_back(force[a]);
    old = force;
    if (cutting && i % STEPS == STEPS - 1 && i > 34 * STEPS) {
      if (change <= 0.1 * all) {
        study.grown = NAN;
      } else if (std::isnan(study.grown)) {
        study.grown = t - turn;
      }
    }
    if (i % DECIMATION == 0) {
      block.force[0].push_back(force[0] + noise(random));
      block.force[1].push_back(force[1] + noise(random));
      block.force[2].push_back(noise(random));
    }
    if (block.force[0].size() == 256) {
      block.stamp = t - 255.0 / rate;
      detector.handle(block);
      block.first_index += 256;
      for (auto& axis : block.force) axis.clear();
    }
    streams.at(t, cutting);
  }
  study.frequency = strongestLine(late, STEPS / DECIMATION, rate);
  return study;
}

// Cuts at least 10 % away from the limit on both sides: false alarms, detections, delay and frequency.
TEST(DetectionStudy, falseAlarmsAndDetections) {
  const int cuts = std::getenv("SMARTMILL_STUDY") ? 300 : 60;
  RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  system.modes = systemModes(stiff(), stiff());
  system.teeth = 3;  // odd: a flip is not a spindle harmonic
  const auto solver = makeFloquetSolver(Method::collocation, system);
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit;
  int stable = 0, alarms = 0, chattering = 0, found = 0, near = 0;
  std::vector<double> delays;
  for (int i = 0; i < cuts;) {
    const double speed = radPerSecFromRpm(4000.0 + 8000.0 * unit(random));
    const double limit = solver->limit(speed, 20e-3).depth;
    if (!std::isfinite(limit)) continue;
    const double depth = limit * (i % 2 ? 0.4 + 0.5 * unit(random) : 1.2 + 0.8 * unit(random));
    const auto at = solver->at(speed);
    const bool chatters = at->multiplier(depth).radius() > 1.0;
    // Only cuts that are at least 10 % away from a boundary; a pocket may follow above the first loss.
    if ((at->multiplier(1.1 * depth).radius() > 1.0) != chatters ||
        (at->multiplier(0.9 * depth).radius() > 1.0) != chatters)
      continue;
    const Study study = cutOnce(system, speed, depth, static_cast<unsigned>(100 + i));
    const std::vector<ChatterEpisode> detected = episodes(study.states);
    ++i;
    if (!chatters) {
      ++stable;
      alarms += !detected.empty();
      continue;
    }
    // The noiseless force decides whether the chatter grew within the cut.
    if (std::isnan(study.grown)) continue;
    ++chattering;
    if (detected.empty()) continue;
    ++found;
    delays.push_back((detected.front().detected - study.grown) * speed / units::TWO_PI);
    near += std::abs(detected.back().frequency - study.frequency) < 0.01 * study.frequency;
  }
  std::sort(delays.begin(), delays.end());
  const double median = delays.empty() ? NAN : delays[delays.size() / 2];
  std::cout << alarms << " false alarms in " << stable << " stable cuts; " << found << " of " << chattering
            << " detected, median delay " << median << " revolutions after the force stopped repeating; "
            << near << " frequencies within 1 %\n";
  EXPECT_LE(alarms, 0.01 * stable);
  EXPECT_GE(found, 0.98 * chattering);
  EXPECT_LE(median, 24.0);  // one window and one hop
  EXPECT_GE(near, 0.9 * found);
}

TEST(Episodes, joinWindowsOfOneCut) {
  const auto state = [](double stamp, const char* cut, bool chatter, double f, double severity) {
    ChatterState s;
    s.stamp = stamp;
    s.condition = cut;
    s.valid = true;
    s.chatter = chatter;
    s.frequency = f;
    s.severity = severity;
    s.onset = chatter ? stamp - 0.1 : NAN;
    return s;
  };
  const auto found =
      episodes({state(1, "a", false, 100, 1), state(2, "a", true, 900, 20), state(3, "a", true, 910, 40),
                state(4, "a", true, 911, 30), state(5, "b", true, 700, 10), state(6, "b", false, 1, 1)});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].condition, "a");
  EXPECT_EQ(found[0].onset, 1.9);
  EXPECT_EQ(found[0].detected, 2.0);
  EXPECT_EQ(found[0].end, 4.0);
  EXPECT_EQ(found[0].frequency, 910.0);
  EXPECT_EQ(found[0].severity, 40.0);
  EXPECT_EQ(found[1].frequency, 700.0);
  EXPECT_TRUE(episodes({}).empty());
}

TEST(ChatterSpeeds, toothPassingFrequencyDividesTheChatterFrequency) {
  const auto speeds = speedsFromChatter(950.0, 2, radPerSecFromRpm(6000.0), radPerSecFromRpm(20000.0));
  ASSERT_EQ(speeds.size(), 3u);  // 28500, then 14250, 9500, 7125 rpm, then 5700
  EXPECT_NEAR(units::rpmFromRadPerSec(speeds[0]), 14250.0, 1e-9);
  EXPECT_NEAR(units::rpmFromRadPerSec(speeds[1]), 9500.0, 1e-9);
  EXPECT_NEAR(units::rpmFromRadPerSec(speeds[2]), 7125.0, 1e-9);
  EXPECT_THROW(speedsFromChatter(0.0, 2, 100.0, 200.0), Error);
}

// The limit at the proposed speed is several times that at the speed with chatter.
TEST(ChatterSpeeds, lieInAPocket) {
  const auto solver = makeSolver(Method::collocation, benchmarkSystem(0.5, true, true));
  const double speed = radPerSecFromRpm(15000.0);
  const Limit limit = solver->limit(speed, 10e-3);
  const auto speeds =
      speedsFromChatter(limit.frequency, 2, radPerSecFromRpm(10000.0), radPerSecFromRpm(20000.0));
  ASSERT_FALSE(speeds.empty());
  EXPECT_GT(solver->limit(speeds.front(), 10e-3).depth, 3.0 * limit.depth);
}

/// A machine, and a prior model of it with a y mode 3 % low.
std::array<RegenerativeSystem, 2> truthAndPrior() {
  const ModalModel x{{{700.0, 0.03, 4e-8}}, 0.0};
  ModalModel y = benchmark();
  RegenerativeSystem truth = benchmarkSystem(0.5, true, true);
  truth.modes = systemModes(x, y);
  RegenerativeSystem prior = truth;
  y.modes[0].frequency /= 1.03;
  prior.modes = systemModes(x, y);
  return {truth, prior};
}

// The frequency of one cut with chatter identifies the wrong mode and its error.
TEST(Correction, findsTheModeAndItsError) {
  const auto systems = truthAndPrior();
  const RegenerativeSystem &truth = systems[0], &prior = systems[1];
  for (const double rpm : {9000.0, 13000.0, 17000.0}) {
    const double speed = radPerSecFromRpm(rpm);
    const double limit = makeSolver(Method::collocation, truth)->limit(speed, 10e-3).depth;
    if (!std::isfinite(limit)) continue;
    const double depth = 1.2 * limit;
    const double observed = makeFloquetSolver(Method::collocation, truth)->at(speed)->chatterFrequency(depth);
    const auto correction = correctFromChatter(prior, speed, depth, observed);
    ASSERT_TRUE(correction) << rpm;
    EXPECT_EQ(correction->mode, 1u) << rpm;
    EXPECT_NEAR(correction->factor, 1.03, 0.004) << rpm;
    EXPECT_TRUE(correction->chatters);
    // The corrected limit is the true one.
    const double corrected = makeSolver(Method::collocation, correction->system)->limit(speed, 10e-3).depth;
    EXPECT_NEAR(corrected / limit, 1.0, 0.1) << rpm;
  }
}

TEST(Correction, isEmptyWithoutAFit) {
  // No mode within the largest change.
  EXPECT_FALSE(
      correctFromChatter(benchmarkSystem(1.0, true, false), radPerSecFromRpm(40000.0), 0.2e-3, 1900.0, 0.02));
  EXPECT_THROW(correctFromChatter(benchmarkSystem(1.0, true, false), 1000.0, 1e-3, -1.0), Error);
}

// A prior model with one mode 3 % low, and verdicts with the true frequency: one advice per episode, with
// mode, factor and speeds whose limit is several times that of the cut.
TEST(Advisor, advisesOncePerEpisode) {
  const auto systems = truthAndPrior();
  const RegenerativeSystem &truth = systems[0], &prior = systems[1];
  const double speed = radPerSecFromRpm(13000.0);
  CuttingCondition condition;
  condition.name = "cut";
  condition.spindle_speed = speed;
  condition.engagement = {truth.entry, truth.exit, 0.0, 0.1e-3};
  const double limit = makeSolver(Method::collocation, truth)->limit(speed, 10e-3).depth;
  condition.engagement.axial_depth = 1.2 * limit;
  const double observed =
      makeFloquetSolver(Method::collocation, truth)->at(speed)->chatterFrequency(1.2 * limit);
  std::vector<ChatterAdvice> given;
  ChatterAdvisor advisor(
      radPerSecFromRpm(8000.0), radPerSecFromRpm(40000.0), 2,
      [&](const CuttingCondition&) { return std::optional<RegenerativeSystem>(prior); },
      [&](const ChatterAdvice& advice) { given.push_back(advice); });
  advisor.handle(condition);
  CuttingCondition next = condition;  // received ahead of its time
  next.name = "next";
  next.spindle_speed = 100.0;
  advisor.handle(next);
  ChatterState state;
  state.valid = true;
  state.condition = "cut";
  double stamp = 1.0;
  const auto verdict = [&](bool chatter, double frequency) {
    state.chatter = chatter;
    state.frequency = frequency;
    state.stamp = stamp++;
    advisor.handle(state);
  };
  verdict(false, 100.0);
  verdict(true, 3.0 * observed);  // growing chatter with another dominant line
  EXPECT_TRUE(given.empty());
  verdict(true, observed);
  EXPECT_TRUE(given.empty());
  verdict(true, 1.001 * observed);
  ASSERT_EQ(given.size(), 1u);
  verdict(true, observed);
  EXPECT_EQ(given.size(), 1u);
  verdict(false, 100.0);
  verdict(true, observed);
  verdict(true, observed);
  EXPECT_EQ(given.size(), 2u);
  const ChatterAdvice& advice = given.front();
  EXPECT_EQ(advice.stamp, 4.0);
  ASSERT_TRUE(advice.correction);
  EXPECT_EQ(advice.correction->mode, 1u);
  EXPECT_NEAR(advice.correction->factor, 1.03, 0.004);
  EXPECT_NEAR(advice.believed_frequency, 922.0 / 1.03, 1e-9);
  EXPECT_NEAR(advice.corrected_limit / limit, 1.0, 0.1);
  ASSERT_FALSE(advice.speeds.empty());
  // The chatter is a flip: the speed of its frequency is included, but a speed of a modal frequency comes
  // first.
  const double step = units::TWO_PI * 1.0005 * observed / 2.0;
  EXPECT_TRUE(std::any_of(advice.speeds.begin(), advice.speeds.end(),
                          [&](const auto& s) { return std::abs(s.speed - step) < 1.0; }));
  EXPECT_GT(advice.speeds.front().limit, 2.0 * limit);
  const double true_limit =
      makeSolver(Method::collocation, truth)->limit(advice.speeds.front().speed, 10e-3).depth;
  EXPECT_GT(true_limit, 1.5 * limit);
}

TEST(Advisor, withoutAPriorModelProposesSpeedsWithoutLimits) {
  std::vector<ChatterAdvice> given;
  ChatterAdvisor advisor(
      100.0, 4000.0, 4, [](const CuttingCondition&) { return std::nullopt; },
      [&](const ChatterAdvice& advice) { given.push_back(advice); });
  ChatterState state;
  state.valid = state.chatter = true;
  state.frequency = 800.0;
  state.condition = "cut";
  advisor.handle(state);
  advisor.handle(state);
  ASSERT_EQ(given.size(), 1u);
  EXPECT_FALSE(given[0].correction);
  ASSERT_FALSE(given[0].speeds.empty());
  EXPECT_NEAR(given[0].speeds[0].speed, units::TWO_PI * 200.0, 1e-9);
  EXPECT_TRUE(std::isnan(given[0].speeds[0].limit));
}

// A limit for an engagement that changes would correct a mode that is right.
TEST(Advisor, anUnsteadyCutCorrectsNoMode) {
  std::vector<ChatterAdvice> given;
  ChatterAdvisor advisor(
      100.0, 4000.0, 4,
      [](const CuttingCondition&) { return std::optional<RegenerativeSystem>(truthAndPrior()[1]); },
      [&](const ChatterAdvice& advice) { given.push_back(advice); });
  CuttingCondition condition;
  condition.kind = CuttingCondition::Kind::unsteady;
  condition.name = "corner";
  condition.spindle_speed = radPerSecFromRpm(13000.0);
  condition.engagement = {1.0, units::PI, 1e-3, 0.1e-3};
  advisor.handle(condition);
  ChatterState state;
  state.valid = state.chatter = true;
  state.frequency = 800.0;
  state.condition = "corner";
  advisor.handle(state);
  advisor.handle(state);
  ASSERT_EQ(given.size(), 1u);
  EXPECT_FALSE(given[0].correction);
  ASSERT_FALSE(given[0].speeds.empty());
  EXPECT_TRUE(std::isnan(given[0].speeds[0].limit));
}

}  // namespace
}  // namespace smartmill::stability
