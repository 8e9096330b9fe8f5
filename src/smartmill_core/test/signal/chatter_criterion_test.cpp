// Synthetic windows of 32 revolutions with known lines: orders are those of the spindle, a tool with four
// teeth.

#include "smartmill_core/signal/chatter_criterion.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "smartmill_core/units.h"

namespace smartmill {
namespace {

constexpr std::size_t BINS = 200, TURNS = 32;
constexpr int TEETH = 4;
constexpr double PERIOD = 0.01;  // [s]: 6000 rpm

struct Tone {
  double order, amplitude;
};

/// @param growth [1/revolution] of the tones that are not harmonics
RevolutionWindow window(const std::vector<Tone>& tones, double noise, double growth = 0.0) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0.0, noise);
  std::vector<double> channel;
  for (std::size_t i = 0; i < BINS * TURNS; ++i) {
    const double turn = static_cast<double>(i) / BINS;
    double value = normal(random);
    for (const Tone& tone : tones) {
      const bool harmonic = tone.order == std::round(tone.order);
      value += tone.amplitude * (harmonic ? 1.0 : std::exp(growth * turn)) *
               std::sin(units::TWO_PI * tone.order * turn + tone.order);
    }
    channel.push_back(value);
  }
  RevolutionWindow result(BINS, TURNS, TEETH);
  result.add(channel);
  return result;
}

ChatterEvidence judge(const RevolutionWindow& window, const ChatterCriterionOptions& options = {}) {
  return ChatterCriterion(options).judge(window, PERIOD);
}

const std::vector<Tone> FORCED{{4.0, 10.0}, {8.0, 4.0}, {1.0, 2.0}};

std::vector<Tone> with(std::vector<Tone> tones) {
  tones.insert(tones.end(), FORCED.begin(), FORCED.end());
  return tones;
}

/// 16 revolutions of a cut whose forced vibration grows smoothly from a fifth to its full size and back.
/// @param chatter amplitude of a line 1.4 orders above the third tooth passing harmonic @param runout part of
/// the forced vibration that does not repeat from tooth to tooth
RevolutionWindow corner(RevolutionWindow::Cut cut, double chatter, double runout) {
  constexpr std::size_t REVOLUTIONS = 16;
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0.0, 0.3);
  std::vector<double> channel;
  for (std::size_t i = 0; i < BINS * REVOLUTIONS; ++i) {
    const double turn = static_cast<double>(i) / BINS, angle = units::TWO_PI * turn;
    const double size = 0.6 - 0.4 * std::cos(angle / REVOLUTIONS);
    channel.push_back(
        size * (10.0 * std::sin(4.0 * angle) + 4.0 * std::sin(8.0 * angle) + runout * std::sin(angle + 0.3)) +
        chatter * std::sin(13.4 * angle) + normal(random));
  }
  RevolutionWindow result(BINS, REVOLUTIONS, TEETH, cut);
  result.add(channel);
  return result;
}

TEST(ChatterCriterion, aChangeOfTheEngagementIsForcedVibration) {
  using Cut = RevolutionWindow::Cut;
  for (const double runout : {0.0, 2.0}) {
    // The mean over the revolutions leaves the change.
    EXPECT_GT(judge(corner(Cut::steady, 0.0, runout)).energy_ratio, 0.15) << runout;
    const ChatterEvidence stable = judge(corner(Cut::unsteady, 0.0, runout));
    EXPECT_FALSE(stable.chatter) << runout;
    // Noise of 0.09 in a forced vibration of at least 0.44 times 58, the mean square of `size`.
    EXPECT_LT(stable.energy_ratio, 0.09 / (0.44 * 58.0)) << runout;
    const ChatterEvidence chatter = judge(corner(Cut::unsteady, 4.0, runout));
    EXPECT_TRUE(chatter.chatter) << runout;
    EXPECT_NEAR(chatter.order, 13.4, 0.02) << runout;
    // Amplitude over sqrt(2); the noise adds less than 1 %, both removals take less than 5 %.
    EXPECT_NEAR(chatter.severity, 4.0 / std::sqrt(2.0), 0.15) << runout;
  }
}

// A change faster than half a cycle in a revolution is none of the engagement.
TEST(ChatterCriterion, aVibrationBetweenTheToothPassingHarmonicsRemainsInAnUnsteadyCut) {
  for (const double distance : {0.7, 1.3, 2.0}) {
    RevolutionWindow result(BINS, 16, TEETH, RevolutionWindow::Cut::unsteady);
    std::vector<double> channel;
    for (std::size_t i = 0; i < BINS * 16; ++i) {
      const double angle = units::TWO_PI * static_cast<double>(i) / BINS;
      channel.push_back(std::sin((8.0 + distance - 0.03) * angle));
    }
    result.add(channel);
    const bool synchronous = distance == 2.0;  // a line within one of a spindle harmonic
    EXPECT_EQ(result.remainder() > 0.4, !synchronous) << distance << ' ' << result.remainder();
  }
}

TEST(ChatterCriterion, forcedVibrationIsNoChatter) {
  const ChatterEvidence evidence = judge(window(FORCED, 1.0));
  EXPECT_FALSE(evidence.chatter);
  // 1 of noise; 60 = (100 + 16 + 4) / 2 of forced vibration.
  EXPECT_NEAR(evidence.energy_ratio, 1.0 / 61.0, 0.002);
  EXPECT_NEAR(evidence.synchronous, 60.0, 1.0);
}

// A family one tooth passing frequency apart, in noise of the same energy.
TEST(ChatterCriterion, aFamilyOfLinesInNoiseIsChatter) {
  const ChatterEvidence evidence = judge(window(with({{10.37, 8.0}, {6.37, 2.0}, {14.37, 2.0}}), 6.0));
  ASSERT_TRUE(evidence.chatter);
  EXPECT_NEAR(evidence.order, 10.37, 0.01);
  EXPECT_EQ(evidence.companions, 2);
  // 32 + 2 + 2; noise of 36 in 3200 lines adds to it by chance.
  EXPECT_NEAR(evidence.power, 36.0, 3.0);
  EXPECT_NEAR(evidence.line_power, 32.0, 3.0);
}

// Unequal teeth add multiples of the spindle frequency; the mirrored line of order -1.63 is 1.63.
TEST(ChatterCriterion, companionsMayBeOneRevolutionAwayOrMirrored) {
  EXPECT_TRUE(judge(window(with({{10.37, 8.0}, {11.37, 2.0}, {9.37, 2.0}}), 6.0)).chatter);
  EXPECT_FALSE(judge(window(with({{10.37, 8.0}, {11.37, 2.0}}), 6.0)).chatter);  // two tones by chance
  EXPECT_TRUE(judge(window(with({{2.37, 8.0}, {1.63, 2.0}}), 6.0)).chatter);
}

TEST(ChatterCriterion, noiseIsNoChatter) {
  const ChatterEvidence evidence = judge(window({{4.0, 1.0}}, 6.0));
  EXPECT_GT(evidence.energy_ratio, 0.9);
  EXPECT_FALSE(evidence.chatter);
}

// Tones of another machine have no companions, unlike those of the tool; one that outweighs all the rest is
// chatter on a sensor of the machine.
TEST(ChatterCriterion, unrelatedTonesAreNoChatter) {
  EXPECT_FALSE(judge(window(with({{10.37, 6.0}, {17.74, 5.0}, {3.19, 4.0}}), 1.0)).chatter);
  EXPECT_TRUE(judge(window(with({{10.37, 6.0}}), 1.0)).chatter);
}

TEST(ChatterCriterion, aTransientDecaysAndChatterGrows) {
  EXPECT_FALSE(judge(window(with({{10.37, 30.0}}), 1.0, -0.2)).chatter);
  const ChatterEvidence grown = judge(window(with({{10.37, 0.01}}), 0.1, 0.25));
  ASSERT_TRUE(grown.chatter);
  EXPECT_GT(grown.onset, 20u);
  EXPECT_LT(grown.onset, TURNS);
}

TEST(ChatterCriterion, aFlipAlternatesFromToothToTooth) {
  const RevolutionWindow flip = window(with({{2.0, 8.0}, {6.0, 2.0}}), 1.0);
  const ChatterEvidence evidence = judge(flip);
  EXPECT_TRUE(evidence.chatter && evidence.flip);
  EXPECT_EQ(evidence.order, 2.0);
  EXPECT_NEAR(evidence.alternation, 34.0 / 95.0, 0.01);
  EXPECT_FALSE(judge(window(with({{2.0, 2.0}}), 1.0)).chatter);  // runout
  ChatterCriterionOptions never;
  never.alternation_ratio = 1.0;
  EXPECT_FALSE(judge(flip, never).chatter);
}

// The force of the teeth with and without one of them: sin(phi) in half immersion, sin(phi) cos(phi) in a
// slot.
TEST(ChatterCriterion, aLostToothIsNoFlip) {
  for (const bool slot : {false, true}) {
    for (const int teeth : {4, 6}) {
      for (const bool lost : {false, true}) {
        RevolutionWindow window(BINS, TURNS, teeth);
        std::vector<double> force(BINS * TURNS, 0.0);
        for (std::size_t i = 0; i < force.size(); ++i) {
          for (int tooth = lost ? 1 : 0; tooth < teeth; ++tooth) {
            const double turn = static_cast<double>(i % BINS) / BINS + static_cast<double>(tooth) / teeth;
            const double phi = units::TWO_PI * (turn - std::floor(turn));
            if (phi < (slot ? units::PI : 0.5 * units::PI))
              force[i] += std::sin(phi) * (slot ? std::cos(phi) : 1.0);
          }
        }
        window.add(force);
        const ChatterEvidence evidence = ChatterCriterion({}).judge(window, PERIOD);
        EXPECT_FALSE(evidence.chatter) << teeth << " teeth";
        if (lost) {
          EXPECT_GT(evidence.alternation, 0.05) << teeth << " teeth";
        }
      }
    }
  }
}

TEST(ChatterCriterion, linesOfTheBackgroundAreNoChatter) {
  const ChatterCriterion criterion({});
  const RevolutionWindow cut = window(with({{10.37, 8.0}, {6.37, 2.0}}), 1.0);
  const RevolutionWindow same = window({{10.37, 8.0}, {6.37, 2.0}}, 1.0), other = window({{7.77, 8.0}}, 1.0);
  EXPECT_FALSE(criterion.judge(cut, PERIOD, same.power()).chatter);
  const ChatterEvidence evidence = criterion.judge(cut, PERIOD, other.power());
  EXPECT_TRUE(evidence.chatter);
  EXPECT_GT(evidence.over_background, 100.0);
}

TEST(ChatterCriterion, knownModesAndTheBandLimitTheLines) {
  const RevolutionWindow cut = window(with({{10.37, 8.0}, {6.37, 2.0}}), 1.0);  // 1037 and 637 Hz
  ChatterCriterionOptions options;
  options.modes = {1000.0};
  EXPECT_EQ(judge(cut, options).mode, 1000.0);
  options.modes = {600.0};  // of the companion
  EXPECT_TRUE(judge(cut, options).chatter);
  options.modes = {2000.0};
  EXPECT_FALSE(judge(cut, options).chatter);
  options.modes.clear();
  options.lowest_frequency = 1100.0;
  const ChatterEvidence above = judge(cut, options);
  EXPECT_FALSE(above.chatter);
  EXPECT_LT(above.energy_ratio, 0.02);
}

}  // namespace
}  // namespace smartmill
