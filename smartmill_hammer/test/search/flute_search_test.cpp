#include "smartmill_hammer/search/flute_search.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "../closed_form_machine.h"

namespace smartmill::hammer {
namespace {

double curve(double gap) {
  return std::max(-10.0, 10.0 * (250e-6 / gap - 1.0));
}

// Distance of an angle from the nearest flute [rad].
double missed(const FluteProfile& p, double mounting, double spindle) {
  double least = 10.0;
  for (const double t : p.tooth_angle)
    least = std::min(least, std::abs(nearAngle(spindle + mounting + t, 0.0)));
  return least;
}

// Thesis: the flute within 1.5 degrees. Random cutters, mounting angles and starts; the noise of a 10 ms
// mean.
TEST(FluteSearch, FindsAFluteOfRandomToolsWithinOneAndAHalfDegrees) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal;
  double worst = 0.0;
  int most = 0;
  for (int trial = 0; trial < 400; ++trial) {
    const int teeth = 1 + trial % 8;
    const double pitch = units::TWO_PI / teeth;
    const auto p =
        FluteProfile::even(teeth, (0.3 + 1.5 * uniform(random)) * 1e-3,
                           (0.15 + 0.2 * uniform(random)) * pitch, (0.15 + 0.2 * uniform(random)) * pitch);
    const double mounting = units::TWO_PI * uniform(random), noise = 0.5e-3;
    FluteSearch search(units::TWO_PI * uniform(random), FluteSearchOptions::forPitch(pitch));
    while (search.state() == FluteSearch::State::searching) {
      const double counts = std::round(search.nextAngle() / units::TWO_PI * 4096.0);
      const double angle = units::TWO_PI * std::fmod(counts, 4096.0) / 4096.0;
      const double volt = curve(500e-6 + p.retreat(angle + mounting, 0.0, 0.0)) + noise * normal(random);
      search.addMeasurement(angle, volt, noise);
      ASSERT_LT(static_cast<int>(search.measurements().size()), 120);
    }
    ASSERT_EQ(search.state(), FluteSearch::State::found) << search.reason() << " trial " << trial;
    worst = std::max(worst, missed(p, mounting, search.angle()));
    most = std::max(most, static_cast<int>(search.measurements().size()));
  }
  EXPECT_LT(units::degFromRad(worst), 1.5);
  RecordProperty("worst_deg", std::to_string(units::degFromRad(worst)));
  std::cout << "worst " << units::degFromRad(worst) << " deg, at most " << most << " measurements\n";
}

/// Moves over random cutters with uneven pitch, low teeth, rounded teeth or inserts.
struct Moves {
  double mean = 0.0, worst = 0.0, confidence = 0.0;  // [1], [rad] error, [1]
};
Moves movesOver(bool insert, bool golden_only) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal;
  constexpr int TRIALS = 300;
  Moves moves;
  for (int trial = 0; trial < TRIALS; ++trial) {
    const int teeth = 2 + trial % 5;
    const double pitch = units::TWO_PI / teeth, depth = (0.5 + uniform(random)) * 1e-3, noise = 0.2e-3;
    const double front = insert ? 0.08 : (0.15 + 0.15 * uniform(random)) * pitch;
    const double back = (0.2 + 0.15 * uniform(random)) * pitch;
    std::vector<double> at, low;
    for (int k = 0; k < teeth; ++k) {
      at.push_back(pitch * (k + (k > 0 ? 0.15 * (uniform(random) - 0.5) : 0.0)));
      low.push_back(40e-6 * uniform(random));
    }
    const auto retreat = [&](double angle) {
      double least = depth;
      for (int k = 0; k < teeth; ++k) {
        const double off = nearAngle(angle + at[static_cast<std::size_t>(k)], 0.0);
        const double width = off > 0.0 ? back : front;
        const double behind = insert && off > 0.0 ? depth * off / width
                                                  : depth * (1.0 - std::exp(-off * off / (width * width)));
        least = std::min(least, low[static_cast<std::size_t>(k)] + behind);
      }
      return least;
    };
    FluteSearchOptions options = FluteSearchOptions::forPitch(0.85 * pitch);
    options.golden_only = golden_only;
    FluteSearch search(units::TWO_PI * uniform(random), options);
    while (search.state() == FluteSearch::State::searching) {
      const double angle = std::round(search.nextAngle() / units::TWO_PI * 4096.0) / 4096.0 * units::TWO_PI;
      search.addMeasurement(angle, curve(500e-6 + retreat(angle)) + noise * normal(random), noise);
    }
    EXPECT_EQ(search.state(), FluteSearch::State::found) << search.reason();
    double off = 10.0;
    for (const double a : at) off = std::min(off, std::abs(nearAngle(search.angle() + a, 0.0)));
    moves.worst = std::max(moves.worst, off);
    moves.mean += static_cast<int>(search.measurements().size()) / static_cast<double>(TRIALS);
    moves.confidence += search.confidence() / TRIALS;
  }
  return moves;
}

// The thesis bounds the bracket by 1.5 degrees; an insert's edge is found as precisely.
TEST(FluteSearch, FindsUnevenTeethAndInsertsInFewerMovesThanTheThesis) {
  for (const bool insert : {false, true}) {
    const Moves ours = movesOver(insert, false), thesis = movesOver(insert, true);
    EXPECT_LT(units::degFromRad(ours.worst), 1.5) << insert;
    EXPECT_GT(ours.confidence, 0.95) << insert;
    std::cout << (insert ? "insert: " : "flute: ") << ours.mean << " moves, golden section alone "
              << thesis.mean << "\n";
    // A sharp edge is no parabola.
    EXPECT_LT(ours.mean, insert ? thesis.mean + 0.5 : thesis.mean - 1.0);
  }
}

TEST(FluteSearch, HasLowConfidenceWithinTheNoise) {
  // A land of six degrees has no distinct top.
  FluteSearch search(0.5, FluteSearchOptions::forPitch(units::PI / 2));
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  while (search.state() == FluteSearch::State::searching) {
    const double off = std::abs(nearAngle(4.0 * search.nextAngle(), 0.0)) / 4.0;
    const double retreat = 1e-3 * std::min(1.0, std::max(0.0, off - 0.05) / 0.3);
    search.addMeasurement(search.nextAngle(), curve(500e-6 + retreat) + 0.5e-3 * normal(random), 0.5e-3);
  }
  ASSERT_EQ(search.state(), FluteSearch::State::found);
  EXPECT_LT(search.confidence(), 0.9);
  EXPECT_LT(std::abs(nearAngle(4.0 * search.angle(), 0.0)) / 4.0, 0.05 + units::radFromDeg(1.5));
}

TEST(FluteSearch, CrossesTheSaturatedInterval) {
  // Out of range but for 20 degrees about the only flute.
  const auto p = FluteProfile::even(1, 50e-3, 0.8, 0.8);
  for (int start = 0; start < 72; ++start) {
    FluteSearch search(start * units::PI / 36.0, FluteSearchOptions::forPitch(units::TWO_PI));
    while (search.state() == FluteSearch::State::searching) {
      double volt = curve(500e-6 + p.retreat(search.nextAngle(), 0.0, 0.0));
      if (volt < -9.5) volt = -10.0;
      search.addMeasurement(search.nextAngle(), volt, 1e-4);
    }
    ASSERT_EQ(search.state(), FluteSearch::State::found) << start << " " << search.reason();
    EXPECT_LT(units::degFromRad(missed(p, 0.0, search.angle())), 1.5) << start;
  }
}

TEST(FluteSearch, StatesThatThereIsNoFlute) {
  for (const double level : {-10.0, -3.0}) {  // out of range; a round shank
    std::mt19937 random(2);
    std::normal_distribution<double> normal;
    FluteSearch search(0.4, FluteSearchOptions::forPitch(units::PI / 2));
    while (search.state() == FluteSearch::State::searching) {
      search.addMeasurement(search.nextAngle(), std::max(-10.0, level + 1e-3 * normal(random)), 1e-3);
      ASSERT_LT(static_cast<int>(search.measurements().size()), 60);
    }
    EXPECT_EQ(search.state(), FluteSearch::State::no_flute);
    EXPECT_NE(search.reason().find("no flute"), std::string::npos) << search.reason();
  }
}

// Golden section: each step shortens the bracket to 0.618 of it (after at most two steps from a bracket that
// is not golden, 0.69 each), so the number of steps from a width w to the tolerance t is bounded by
// log(w/t)/log(1.618) + 2.
TEST(FluteSearch, GoldenSectionTakesNoMoreStepsThanItsBound) {
  const auto p = FluteProfile::even(4, 1e-3, 0.4, 0.4);
  for (int start = 0; start < 90; ++start) {
    FluteSearch search(units::radFromDeg(start), FluteSearchOptions::forPitch(units::PI / 2));
    int steps = 0;
    double width = 0.0;
    while (search.state() == FluteSearch::State::searching) {
      const bool sectioning = search.bracketWidth() > 0.0;
      search.addMeasurement(search.nextAngle(), curve(500e-6 + p.retreat(search.nextAngle(), 0.0, 0.0)),
                            1e-6);
      if (sectioning) {
        ++steps;
      } else {
        width = search.bracketWidth();
      }
    }
    ASSERT_EQ(search.state(), FluteSearch::State::found);
    EXPECT_LE(width, units::radFromDeg(70.0));
    EXPECT_LE(steps, std::ceil(std::log(width / units::radFromDeg(1.5)) / std::log(1.618034)) + 2) << start;
  }
}

// Eq. 4.7: 5.6 degrees first, each step longer by the golden ratio, 22.5 degrees at most.
TEST(FluteSearch, BracketsByTheThesisSteps) {
  FluteSearch search(0.0, FluteSearchOptions::forPitch(units::PI / 2));
  std::vector<double> angles;
  for (int i = 0; i < 7; ++i) {
    angles.push_back(units::degFromRad(search.nextAngle()));
    search.addMeasurement(search.nextAngle(), 0.1 * i, 1e-6);
  }
  EXPECT_NEAR(angles[1] - angles[0], 5.6, 0.01);
  EXPECT_NEAR(angles[2] - angles[1], 5.6 * 1.618034, 0.01);
  EXPECT_NEAR(angles[3] - angles[2], 5.6 * 1.618034 * 1.618034, 0.02);
  EXPECT_NEAR(angles[4] - angles[3], 22.5, 0.01);
  EXPECT_NEAR(angles[5] - angles[4], 22.5, 0.01);
}

TEST(FluteSearch, AnglesAreModuloARevolution) {
  EXPECT_NEAR(nearAngle(0.1, 2.0 * units::TWO_PI), 2.0 * units::TWO_PI + 0.1, 1e-12);
  EXPECT_NEAR(nearAngle(6.2, 0.0), 6.2 - units::TWO_PI, 1e-12);
}

}  // namespace
}  // namespace smartmill::hammer
