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

/// The benchmark with 25 times the stiffness: cuts of a millimetre and of hundreds of newtons.
ModalModel stiff() {
  ModalModel model = benchmark();
  model.modes[0].gain /= 25.0;
  return model;
}

/// Verdicts of the detector on a simulated cut: runout, noise, a tool that sinks in, an end in the air.
struct Study {
  std::vector<ChatterState> states;
  /// [s] from when the noiseless force fails the detector's ratio, turn by turn, to the end
  double grown = NAN;
  /// [Hz] strongest line of the noiseless force without its mean over the last 60 turns
  double frequency = NAN;
};

Study cutOnce(const RegenerativeSystem& system, double speed, double depth, unsigned seed) {
  constexpr int STEPS = 720, TURNS = 170, AIR = 10, KEPT = 4, LATE = 60;
  TimeDomain run(system, stiff(), stiff(), speed, depth, 0.1e-3, STEPS);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0.0, 3.0), runout(0.0, 5e-6);
  std::vector<double> offsets;
  for (int k = 0; k < system.teeth; ++k) offsets.push_back(runout(random));
  run.setRunout(offsets);
  const double turn = units::TWO_PI / speed, rate = STEPS / KEPT / turn;
  Study study;
  ChatterDetector detector(ChatterParameters(),
                           [&](const ChatterState& state) { study.states.push_back(state); });
  CutStreams streams(detector, speed, ToolGeometry(), 30.0 * turn);  // in full engagement after 30 turns
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
    // Turn by turn: what does not repeat against what there is.
    if (i % STEPS == 0) change = all = 0.0;
    auto& old = before[static_cast<std::size_t>(i % STEPS)];
    for (std::size_t a = 0; a < 2; ++a) {
      change += 0.5 * std::pow(force[a] - old[a], 2);
      all += force[a] * force[a];
    }
    if (cutting && i >= STEPS * (TURNS - LATE) && i % KEPT == 0)
      for (std::size_t a = 0; a < 2; ++a) late[a].push_back(force[a]);
    old = force;
    if (cutting && i % STEPS == STEPS - 1 && i > 34 * STEPS) {
      if (change <= 0.1 * all) {
        study.grown = NAN;
      } else if (std::isnan(study.grown)) {
        study.grown = t - turn;
      }
    }
    if (i % KEPT == 0) {
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
  study.frequency = strongestLine(late, STEPS / KEPT, rate);
  return study;
}

// Cuts on both sides of the limit, 10 % off at least: false alarms, detections, delay and frequency.
TEST(DetectionStudy, alarmsAndDetections) {
  const int cuts = std::getenv("SMARTMILL_STUDY") ? 300 : 60;
  RegenerativeSystem system = benchmarkSystem(0.5, true, true);
  system.modes = systemModes(stiff(), stiff());
  system.teeth = 3;  // odd: a flip then lies off the spindle's harmonics
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
    // Beyond a first loss a pocket may follow; ask for clear cases.
    if ((at->multiplier(1.1 * depth).radius() > 1.0) != chatters ||
        (at->multiplier(0.9 * depth).radius() > 1.0) != chatters)
      continue;
    const Study study = cutOnce(system, speed, depth, static_cast<unsigned>(100 + i));
    const std::vector<ChatterEpisode> seen = episodes(study.states);
    ++i;
    if (!chatters) {
      ++stable;
      alarms += !seen.empty();
      continue;
    }
    // Whether it came to chatter within this cut the noiseless force says.
    if (std::isnan(study.grown)) continue;
    ++chattering;
    if (seen.empty()) continue;
    ++found;
    delays.push_back((seen.front().detected - study.grown) * speed / units::TWO_PI);
    near += std::abs(seen.back().frequency - study.frequency) < 0.01 * study.frequency;
  }
  std::sort(delays.begin(), delays.end());
  const double median = delays.empty() ? NAN : delays[delays.size() / 2];
  std::cout << alarms << " false alarms in " << stable << " stable cuts; " << found << " of " << chattering
            << " found, median delay " << median << " turns after the force stopped repeating; " << near
            << " frequencies within 1 %\n";
  EXPECT_LE(alarms, 0.01 * stable);
  EXPECT_GE(found, 0.98 * chattering);
  EXPECT_LE(median, 24.0);  // a window and a hop
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

TEST(ChatterSpeeds, meetTheToothPassingFrequency) {
  const auto speeds = speedsFromChatter(950.0, 2, radPerSecFromRpm(6000.0), radPerSecFromRpm(20000.0));
  ASSERT_EQ(speeds.size(), 3u);  // 28500, then 14250, 9500, 7125 rpm, then 5700
  EXPECT_NEAR(units::rpmFromRadPerSec(speeds[0]), 14250.0, 1e-9);
  EXPECT_NEAR(units::rpmFromRadPerSec(speeds[1]), 9500.0, 1e-9);
  EXPECT_NEAR(units::rpmFromRadPerSec(speeds[2]), 7125.0, 1e-9);
  EXPECT_THROW(speedsFromChatter(0.0, 2, 100.0, 200.0), Error);
}

// The speed so found is better: its limit exceeds the one at which it chattered, several times.
TEST(ChatterSpeeds, liesInAPocket) {
  const auto solver = makeSolver(Method::collocation, benchmarkSystem(0.5, true, true));
  const double speed = radPerSecFromRpm(15000.0);
  const Limit limit = solver->limit(speed, 10e-3);
  const auto speeds =
      speedsFromChatter(limit.frequency, 2, radPerSecFromRpm(10000.0), radPerSecFromRpm(20000.0));
  ASSERT_FALSE(speeds.empty());
  EXPECT_GT(solver->limit(speeds.front(), 10e-3).depth, 3.0 * limit.depth);
}

/// A machine, and a belief about it whose y mode is 3 % low.
std::array<RegenerativeSystem, 2> truthAndBelief() {
  const ModalModel x{{{700.0, 0.03, 4e-8}}, 0.0};
  ModalModel y = benchmark();
  RegenerativeSystem truth = benchmarkSystem(0.5, true, true);
  truth.modes = systemModes(x, y);
  RegenerativeSystem belief = truth;
  y.modes[0].frequency /= 1.03;
  belief.modes = systemModes(x, y);
  return {truth, belief};
}

// A belief whose y mode is 3 % low: the frequency of one chattering cut tells which mode and how far.
TEST(Correction, findsTheModeAndItsError) {
  const auto systems = truthAndBelief();
  const RegenerativeSystem &truth = systems[0], &belief = systems[1];
  for (const double rpm : {9000.0, 13000.0, 17000.0}) {
    const double speed = radPerSecFromRpm(rpm);
    const double limit = makeSolver(Method::collocation, truth)->limit(speed, 10e-3).depth;
    if (!std::isfinite(limit)) continue;
    const double depth = 1.2 * limit;
    const double observed = makeFloquetSolver(Method::collocation, truth)->at(speed)->chatterFrequency(depth);
    const auto correction = correctFromChatter(belief, speed, depth, observed);
    ASSERT_TRUE(correction) << rpm;
    EXPECT_EQ(correction->mode, 1u) << rpm;
    EXPECT_NEAR(correction->factor, 1.03, 0.004) << rpm;
    EXPECT_TRUE(correction->chatters);
    // The corrected chart is the true one again.
    const double corrected = makeSolver(Method::collocation, correction->system)->limit(speed, 10e-3).depth;
    EXPECT_NEAR(corrected / limit, 1.0, 0.1) << rpm;
  }
}

TEST(Correction, nothingFitsIsSaid) {
  // 40 % beside any mode.
  EXPECT_FALSE(
      correctFromChatter(benchmarkSystem(1.0, true, false), radPerSecFromRpm(40000.0), 0.2e-3, 1900.0, 0.02));
  EXPECT_THROW(correctFromChatter(benchmarkSystem(1.0, true, false), 1000.0, 1e-3, -1.0), Error);
}

// A belief 3 % low in one mode, and verdicts with the true frequency: advice once, with mode, factor and
// speeds whose limit is several times that of the cut.
TEST(Advisor, advisesOnceAnEpisode) {
  const auto systems = truthAndBelief();
  const RegenerativeSystem &truth = systems[0], &belief = systems[1];
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
      [&](const CuttingCondition&) { return std::optional<RegenerativeSystem>(belief); },
      [&](const ChatterAdvice& advice) { given.push_back(advice); });
  advisor.handle(condition);
  CuttingCondition next = condition;  // told ahead of its time
  next.name = "next";
  next.spindle_speed = 100.0;
  advisor.handle(next);
  ChatterState state;
  state.valid = true;
  state.condition = "cut";
  double stamp = 1.0;
  const auto tell = [&](bool chatter, double frequency) {
    state.chatter = chatter;
    state.frequency = frequency;
    state.stamp = stamp++;
    advisor.handle(state);
  };
  tell(false, 100.0);
  tell(true, 3.0 * observed);  // growing still: another line
  EXPECT_TRUE(given.empty());
  tell(true, observed);
  EXPECT_TRUE(given.empty());
  tell(true, 1.001 * observed);
  ASSERT_EQ(given.size(), 1u);
  tell(true, observed);
  EXPECT_EQ(given.size(), 1u);
  tell(false, 100.0);
  tell(true, observed);
  tell(true, observed);
  EXPECT_EQ(given.size(), 2u);
  const ChatterAdvice& advice = given.front();
  EXPECT_EQ(advice.stamp, 4.0);
  ASSERT_TRUE(advice.correction);
  EXPECT_EQ(advice.correction->mode, 1u);
  EXPECT_NEAR(advice.correction->factor, 1.03, 0.004);
  EXPECT_NEAR(advice.believed_frequency, 922.0 / 1.03, 1e-9);
  EXPECT_NEAR(advice.corrected_limit / limit, 1.0, 0.1);
  ASSERT_FALSE(advice.speeds.empty());
  // In step with the chatter is among them (its frequency is the flip's here, no pocket), in step with a mode
  // first.
  const double step = units::TWO_PI * 1.0005 * observed / 2.0;
  EXPECT_TRUE(std::any_of(advice.speeds.begin(), advice.speeds.end(),
                          [&](const auto& s) { return std::abs(s.speed - step) < 1.0; }));
  EXPECT_GT(advice.speeds.front().limit, 2.0 * limit);
  const double there =
      makeSolver(Method::collocation, truth)->limit(advice.speeds.front().speed, 10e-3).depth;
  EXPECT_GT(there, 1.5 * limit);
}

TEST(Advisor, withoutABeliefTheSpeedsAlone) {
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

}  // namespace
}  // namespace smartmill::stability
