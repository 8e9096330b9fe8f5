// Forces of test/tool/cutting_teeth.h; the loss of a tooth and what must not be taken for it.
#include "smartmill_program/tool/tooth_watch.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <random>

#include <gmock/gmock.h>

#include "cutting_teeth.h"
#include "smartmill_core/error.h"

namespace smartmill::program {
namespace {

using units::PI;
using units::TWO_PI;

constexpr double SPEED = 50.0 * TWO_PI;  // [rad/s] 3000 rpm
constexpr double RATE = 10000.0;         // [Hz]

ToolGeometry toolOf(int teeth) {
  ToolGeometry tool;
  tool.teeth = teeth;
  tool.diameter = 0.01;
  return tool;
}

/// @param change [1] of the cut with the revolutions @return the first report within the revolutions
std::optional<ToothLoss> watch(CuttingTeeth teeth, double revolutions,
                               const std::function<void(double, CuttingTeeth&)>& change = {},
                               double noise = 2.0, const ToothWatchParameters& parameters = {}) {
  ToothWatch watch(parameters);
  watch.setTool(toolOf(teeth.teeth));
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.0, noise);
  for (int i = 0; i < revolutions * TWO_PI / SPEED * RATE; ++i) {
    const double time = i / RATE, turned = SPEED * time;
    if (change) change(turned / TWO_PI, teeth);
    ForceSample sample = teeth.at(time, turned);
    sample.fx += normal(random);
    sample.fy += normal(random);
    if (const std::optional<ToothLoss> loss = watch.push(sample)) return loss;
  }
  return {};
}

class Teeth : public ::testing::TestWithParam<int> {};

TEST_P(Teeth, LossIsReportedWithinTwoRevolutionsWithItsTooth) {
  for (const double arc : {0.3, 0.6, 1.0}) {
    for (int j = 0; j < GetParam(); ++j) {
      for (const double at : {20.0, 20.21, 20.47, 20.83}) {
        CuttingTeeth teeth;
        teeth.teeth = GetParam();
        teeth.entry = (1.0 - arc) * PI;
        teeth.missing = j;
        teeth.missing_from = at * TWO_PI;
        const std::optional<ToothLoss> loss = watch(teeth, 30.0);
        SCOPED_TRACE(testing::Message() << "arc " << arc << " tooth " << j << " at " << at);
        ASSERT_TRUE(loss);
        // The tooth need not be in the cut when it is lost: up to one revolution less than at most two.
        EXPECT_LE(loss->stamp * SPEED / TWO_PI, at + 2.0);
        EXPECT_GE(loss->stamp * SPEED / TWO_PI, at + 0.5);
        EXPECT_EQ(loss->tooth, j);
        EXPECT_NEAR(loss->loss, 1.0, 4.0 * loss->loss_std);
        EXPECT_GE(loss->log_likelihood_ratio, 20.0);
        EXPECT_NEAR(loss->lost_at * SPEED / TWO_PI, at + 0.5, 0.6);
      }
    }
  }
}
INSTANTIATE_TEST_SUITE_P(Tools, Teeth, ::testing::Values(2, 3, 4, 5, 6));

TEST(ToothWatch, MeanForceOfATwoToothToolFallsAsTheClosedFormStates) {
  // One of two equal teeth missing: the other one removes twice the chip, (2 K h + E) / (2 (K h + E)) of the
  // mean force. For a tangential slot: mean chip of sin(phi) sin(phi) is feed / 2.
  CuttingTeeth teeth;
  teeth.teeth = 2;
  teeth.radial = 0.0;
  double mean[2] = {0.0, 0.0};
  for (const int k : {0, 1}) {
    if (k == 1) teeth.missing = 0;
    ToothWatch watch{ToothWatchParameters()};
    watch.setTool(toolOf(2));
    for (int i = 0; i < 3600; ++i) {
      watch.push(teeth.at(i * 1e-4, i * TWO_PI / 600.0));
      if (const std::optional<RevolutionForce> r = watch.takeRevolution()) mean[k] = r->force.imag();
    }
  }
  // Fy: tangential K c pi / 2 + E 2 a tooth and half revolution; radial E: no mean along y.
  const double chip = teeth.tangential * teeth.feed * PI / 2.0, edge = 2.0 * teeth.edge;
  // Sampling of the arc: 0.5 %.
  EXPECT_NEAR(mean[1] / mean[0], (2.0 * chip + edge) / (2.0 * (chip + edge)), 5e-3);
}

TEST(ToothWatch, EqualTeethHaveNoRotatingForceAndALostOneThatOfTheFormula) {
  CuttingTeeth teeth;
  for (const bool lost : {false, true}) {
    teeth.missing = lost ? 1 : -1;
    ToothWatch watch{ToothWatchParameters()};
    watch.setTool(toolOf(4));
    std::complex<double> rotating;
    for (int i = 0; i < 3600; ++i) {
      watch.push(teeth.at(i * 1e-4, i * TWO_PI / 600.0));
      if (const std::optional<RevolutionForce> r = watch.takeRevolution()) rotating = r->rotating;
    }
    // A over half a revolution: mean chip 2 / pi of the feed.
    const std::complex<double> a(teeth.tangential * teeth.feed / PI + teeth.edge / 2.0,
                                 teeth.radial * teeth.feed / PI + teeth.edge / 2.0);
    const std::complex<double> chip(teeth.tangential * teeth.feed / PI, teeth.radial * teeth.feed / PI);
    const std::complex<double> t1 = std::polar(1.0, -PI / 2.0);
    // Minus the force of the lost tooth 1; tooth 0 removes its chip.
    const std::complex<double> expected = lost ? a * t1 - chip : std::complex<double>(0.0);
    EXPECT_NEAR(std::abs(rotating - expected), 0.0, 0.02 * std::abs(a)) << lost;
  }
}

TEST(ToothWatch, RunoutIsNoLossAndDoesNotHideOne) {
  CuttingTeeth teeth;
  for (int j = 0; j < 4; ++j) teeth.radius[static_cast<std::size_t>(j)] = 10.0 * std::cos(PI / 2.0 * j + 0.4);
  EXPECT_FALSE(watch(teeth, 60.0));
  teeth.missing = 2;
  teeth.missing_from = 30.3 * TWO_PI;
  const std::optional<ToothLoss> loss = watch(teeth, 60.0);
  ASSERT_TRUE(loss);
  EXPECT_EQ(loss->tooth, 2);
  EXPECT_LE(loss->stamp * SPEED / TWO_PI, 32.3);
}

// Runout of 10 um at a feed of 8 um: some teeth are out of the cut. Where the arc narrows, the others leave
// it one by one, which is a lost tooth by its force.
TEST(ToothWatch, TeethThatRunoutKeepsOutOfTheCutAreNoLoss) {
  struct Case {
    int teeth;
    double phase, revolutions;  // [rad] of the runout; until a tenth of the arc
    bool up;
  };
  for (const Case& c : {Case{4, 1.5, 4.0, true}, Case{6, 1.5, 1.5, false}, Case{6, 3.0, 1.5, false},
                        Case{6, 3.0, 2.5, false}}) {
    CuttingTeeth teeth;
    teeth.teeth = c.teeth;
    teeth.feed = 8.0;
    for (int j = 0; j < c.teeth; ++j)
      teeth.radius[static_cast<std::size_t>(j)] = 10.0 * std::cos(TWO_PI / c.teeth * j + c.phase);
    const auto narrows = [&](double n, CuttingTeeth& t) {
      const double arc = PI * std::clamp(1.0 - (n - 20.0) / c.revolutions, 0.1, 1.0);
      if (c.up) {
        t.exit = arc;
      } else {
        t.entry = PI - arc;
      }
    };
    EXPECT_FALSE(watch(teeth, 35.0, narrows)) << c.teeth << " teeth, " << c.revolutions << " revolutions";
  }
}

TEST(ToothWatch, ReportsNothingWhereTheUsualRunoutIsTheFeed) {
  CuttingTeeth teeth;
  teeth.missing = 2;
  teeth.missing_from = 20.3 * TWO_PI;
  const ToothWatchParameters parameters;
  for (const double feed : {0.0, 0.8 * parameters.usual_runout, 1.2 * parameters.usual_runout}) {
    ToothWatch watch(parameters);
    watch.setTool(toolOf(teeth.teeth));
    watch.setFeed(feed);
    bool reported = false;
    for (int i = 0; i < 8000; ++i)
      reported = watch.push(teeth.at(i / RATE, SPEED * i / RATE)).has_value() || reported;
    EXPECT_EQ(reported, feed > parameters.usual_runout) << feed;
  }
}

struct Event {
  const char* name;
  std::function<void(double, CuttingTeeth&)> change;
};

TEST(ToothWatch, ChangesOfTheCutAreNoLoss) {
  const std::vector<Event> events{
      {"override 30 % at once", [](double n, CuttingTeeth& t) { t.feed = n < 20.0 ? 80.0 : 24.0; }},
      {"override 120 % at once", [](double n, CuttingTeeth& t) { t.feed = n < 20.0 ? 80.0 : 96.0; }},
      {"override 10 %, chips below the runout",
       [](double n, CuttingTeeth& t) { t.feed = 40.0 * std::clamp(1.0 - 0.45 * (n - 20.0), 0.1, 1.0); }},
      {"feed hold and restart",
       [](double n, CuttingTeeth& t) {
         t.feed = 80.0 * std::clamp(n < 25.0 ? 21.0 - n : n - 25.0, 0.0, 1.0);
         if (t.feed < 1e-9) t.edge = 0.0;
         if (t.feed > 0.0) t.edge = 50.0;
       }},
      {"entry and exit",
       [](double n, CuttingTeeth& t) {
         t.exit = PI * std::clamp(n < 20.0 ? n / 8.0 : (28.0 - n) / 8.0, 0.0, 1.0);
       }},
      {"exit within a revolution",
       [](double n, CuttingTeeth& t) { t.exit = PI * std::clamp(20.0 - n + 1.0, 0.0, 1.0); }},
      {"corner: the arc doubles",
       [](double n, CuttingTeeth& t) {
         t.entry = PI * (0.7 - 0.4 * std::clamp((n - 20.0) / 3.0, 0.0, 1.0));
       }},
      {"interrupted every fifth revolution",
       [](double n, CuttingTeeth& t) { t.exit = std::fmod(n, 5.0) < 3.0 ? PI : 0.0; }}};
  for (const Event& event : events) {
    for (const int number : {2, 3, 4, 6}) {
      CuttingTeeth teeth;
      teeth.teeth = number;
      for (int j = 0; j < number; ++j)
        teeth.radius[static_cast<std::size_t>(j)] = 10.0 * std::cos(TWO_PI / number * j + 0.4);
      EXPECT_FALSE(watch(teeth, 50.0, event.change)) << event.name << ", teeth " << number;
    }
  }
}

TEST(ToothWatch, NothingIsKnownOfOneToothAirOrTooFewSamples) {
  CuttingTeeth teeth;
  teeth.teeth = 1;
  teeth.missing = 0;
  teeth.missing_from = 20.0 * TWO_PI;
  EXPECT_FALSE(watch(teeth, 40.0));
  CuttingTeeth air;
  air.exit = 0.0;
  EXPECT_FALSE(watch(air, 40.0));
  ToothWatch coarse{ToothWatchParameters()};
  coarse.setTool(toolOf(4));
  CuttingTeeth four;
  four.missing = 1;
  four.missing_from = 20.0 * TWO_PI;
  for (int i = 0; i < 400; ++i) EXPECT_FALSE(coarse.push(four.at(i * 0.1, i * TWO_PI / 8.3)));
}

TEST(ToothWatch, GapBeginsAnew) {
  CuttingTeeth teeth;
  teeth.missing = 1;
  teeth.missing_from = 20.0 * TWO_PI;
  ToothWatch watch{ToothWatchParameters()};
  watch.setTool(toolOf(4));
  for (int i = 0; i < 8000; ++i) {
    const double turned = i * TWO_PI / 200.0;
    if (i == 4040) watch.reset();  // just after the loss: no reference remains
    EXPECT_FALSE(watch.push(teeth.at(i * 1e-4, turned)));
  }
}

TEST(ToothWatch, FalseReportsByNoiseAreAsRareAsStated) {
  // |D|^2 / 2 s^2 exceeds h with probability exp(-h): the reported ratio of a run without any loss stays
  // below the threshold. Noise alone, as large as the force of a tooth: 2000 revolutions.
  CuttingTeeth teeth;
  EXPECT_FALSE(watch(teeth, 2000.0, {}, 200.0));
}

TEST(ToothWatch, RefusesParametersInOneLine) {
  ToothWatchParameters parameters;
  parameters.least_loss = 1.5;
  EXPECT_THAT([&] { ToothWatch watch(parameters); },
              testing::ThrowsMessage<Error>("least_loss: 1.5 is out of range (0 < value < 1)"));
  ToothWatch watch{ToothWatchParameters()};
  EXPECT_THROW(watch.setTool(ToolGeometry()), Error);
}

}  // namespace
}  // namespace smartmill::program
