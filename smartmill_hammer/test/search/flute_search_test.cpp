#include "smartmill_hammer/search/flute_search.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "../closed_form_machine.h"

namespace smartmill {
namespace hammer {
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
      const double counts = std::round(search.next() / units::TWO_PI * 4096.0);
      const double angle = units::TWO_PI * std::fmod(counts, 4096.0) / 4096.0;
      const double volt = curve(500e-6 + p.retreat(angle + mounting, 0.0, 0.0)) + noise * normal(random);
      search.give(angle, volt, noise);
      ASSERT_LT(search.measurements(), 120);
    }
    ASSERT_EQ(search.state(), FluteSearch::State::found) << search.reason() << " trial " << trial;
    worst = std::max(worst, missed(p, mounting, search.angle()));
    most = std::max(most, search.measurements());
  }
  EXPECT_LT(units::degFromRad(worst), 1.5);
  RecordProperty("worst_deg", std::to_string(units::degFromRad(worst)));
  std::cout << "worst " << units::degFromRad(worst) << " deg, at most " << most << " measurements\n";
}

TEST(FluteSearch, WalksOverTheSaturatedStretch) {
  // Out of range but for 20 degrees about the only flute.
  const auto p = FluteProfile::even(1, 50e-3, 0.8, 0.8);
  for (int start = 0; start < 72; ++start) {
    FluteSearch search(start * units::PI / 36.0, FluteSearchOptions::forPitch(units::TWO_PI));
    while (search.state() == FluteSearch::State::searching) {
      double volt = curve(500e-6 + p.retreat(search.next(), 0.0, 0.0));
      if (volt < -9.5) volt = -10.0;
      search.give(search.next(), volt, 1e-4);
    }
    ASSERT_EQ(search.state(), FluteSearch::State::found) << start << " " << search.reason();
    EXPECT_LT(units::degFromRad(missed(p, 0.0, search.angle())), 1.5) << start;
  }
}

TEST(FluteSearch, SaysWhenThereIsNoFlute) {
  for (const double level : {-10.0, -3.0}) {  // out of range; a round shank
    std::mt19937 random(2);
    std::normal_distribution<double> normal;
    FluteSearch search(0.4, FluteSearchOptions::forPitch(units::PI / 2));
    while (search.state() == FluteSearch::State::searching) {
      search.give(search.next(), std::max(-10.0, level + 1e-3 * normal(random)), 1e-3);
      ASSERT_LT(search.measurements(), 60);
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
      search.give(search.next(), curve(500e-6 + p.retreat(search.next(), 0.0, 0.0)), 1e-6);
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
  std::vector<double> asked;
  for (int i = 0; i < 7; ++i) {
    asked.push_back(units::degFromRad(search.next()));
    search.give(search.next(), 0.1 * i, 1e-6);
  }
  EXPECT_NEAR(asked[1] - asked[0], 5.6, 0.01);
  EXPECT_NEAR(asked[2] - asked[1], 5.6 * 1.618034, 0.01);
  EXPECT_NEAR(asked[3] - asked[2], 5.6 * 1.618034 * 1.618034, 0.02);
  EXPECT_NEAR(asked[4] - asked[3], 22.5, 0.01);
  EXPECT_NEAR(asked[5] - asked[4], 22.5, 0.01);
}

TEST(FluteSearch, AnglesAreModuloATurn) {
  EXPECT_NEAR(nearAngle(0.1, 2.0 * units::TWO_PI), 2.0 * units::TWO_PI + 0.1, 1e-12);
  EXPECT_NEAR(nearAngle(6.2, 0.0), 6.2 - units::TWO_PI, 1e-12);
}

}  // namespace
}  // namespace hammer
}  // namespace smartmill
