// Feeds against closed forms of the mechanistic model and of a trapezoidal speed; the planned program is read
// back through the whole analysis.

#include "smartmill_program/plan/feed_planner.h"

#include <cmath>
#include <random>
#include <regex>
#include <sstream>

#include <gmock/gmock.h>

#include "smartmill_core/formatted.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_program/plan/plan_report.h"

namespace smartmill::program {
namespace {

using ::testing::HasSubstr;
using units::MM;

constexpr double MM_PER_MIN = MM / 60.0;  // [m/s]
constexpr double DIGITS = 1e-3;           // [1] a planned feed has four digits and is rounded down

std::string modelText(int teeth, double helix_deg, double kte, double kre) {
  return formatted(
      "format: smartmill-model/1\ntool: {teeth: %d, diameter_mm: 10.0, helix_deg: %g}\ncutting: "
      "{Ktc_n_per_mm2: 800.0, Krc_n_per_mm2: 300.0, Kac_n_per_mm2: 200.0, Kte_n_per_mm: %g, Kre_n_per_mm: "
      "%g, "
      "Kae_n_per_mm: 3.0}\n",
      teeth, helix_deg, kte, kre);
}
const std::string MILL = modelText(4, 30.0, 20.0, 25.0);

FeedLimits generous() {
  FeedLimits limits;
  limits.feed_per_tooth = 1 * MM;
  limits.machine = 20000 * MM_PER_MIN;
  return limits;
}

struct Planned {
  FeedPlan plan;
  double peak_force = 0.0, peak_torque = 0.0, power = 0.0, chip = 0.0, feed_per_tooth = 0.0;  // read back
  std::vector<Move> moves;                                                                    // of the plan
};

/// Plans a program in a stock of 60 x 40 x 10 mm below Z0, and reads the result back.
Planned planOf(const std::string& text, const FeedLimits& limits, const std::string& model = MILL) {
  const TemporaryFolder folder;
  ToolModels models({folder.write("mill.yaml", model)});
  const Stock stock(StockBlock{{0, 0, -10 * MM}, {60 * MM, 40 * MM, 0}}, 0.2 * MM);
  FeedPlanner planner("part.nc", text, {}, models, limits);
  const std::vector<Move> moves = interpretProgram(text, "part.nc");
  Stock cut = stock;
  const AnalysisResult before =
      ProgramAnalysis("part.nc", models, cut).run(moves, [&](const Step& step, const StepPrediction&) {
        planner.add(step);
      });
  Planned result;
  result.plan = planner.plan({moves, before}, {moves, before}, stock, {});
  result.moves = interpretProgram(result.plan.text, "planned.nc");
  Stock again = stock;
  ProgramAnalysis("planned.nc", models, again)
      .run(result.moves, [&](const Step& step, const StepPrediction& prediction) {
        if (step.move->rapid || step.contact.empty()) return;
        result.peak_force = std::max(result.peak_force, prediction.force.peak_force);
        result.peak_torque = std::max(result.peak_torque, prediction.force.peak_torque);
        result.power = std::max(result.power, prediction.power);
        result.feed_per_tooth = std::max(result.feed_per_tooth, prediction.feed_per_tooth);
        result.chip = std::max(result.chip, largestChip(*models.of(0).tool, step.contact,
                                                        prediction.feed_per_tooth * step.feed_share));
      });
  return result;
}

/// [mm/min] Feeds of the lines of a program with a feed motion, in the order of execution.
std::vector<double> feedsOf(const std::vector<Move>& moves) {
  std::vector<double> feeds;
  for (const Move& move : moves)
    if (!move.rapid && move.feed > 0.0) feeds.push_back(move.feed / MM_PER_MIN);
  return feeds;
}

/// Without F words and the blanks before them, comments kept.
std::string withoutFeeds(const std::string& text) {
  std::string result;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line); result += '\n') {
    static const std::regex PARTS(R"((\([^)]*\))|([ \t]*[Ff][ \t]*[-+0-9.]+))");
    result += std::regex_replace(line, PARTS, "$1");
  }
  return result;
}

const std::string START = "G21 G90 G0 X-10 Y20 Z-2\nS3000 M3\n";
const std::string SLOT = START + "G1 X70 F600\nG0 Z5\nM30\n";

// A slot with straight teeth and no edge force: the force is a c sin(phi) |K| with one tooth, and a c |K| at
// every angle with four, since sin^2 + cos^2 = 1 and the mixed terms cancel. c = F / (a |K|).
TEST(FeedPlan, ForceOfASlotWithStraightTeeth) {
  FeedLimits limits = generous();
  limits.force = 150.0;
  const double chip = limits.force / (2 * MM * std::hypot(800e6, 300e6));
  for (const int teeth : {1, 4}) {
    const Planned planned = planOf(SLOT, limits, modelText(teeth, 0.0, 0.0, 0.0));
    const double feed = chip * teeth * 50.0 / MM_PER_MIN;
    EXPECT_NEAR(feedsOf(planned.moves).at(0), feed, 1.2 * DIGITS * feed) << teeth;
    EXPECT_LE(planned.peak_force, limits.force * (1 + 1e-9));
    ASSERT_EQ(planned.plan.blocks.size(), 1u);
    EXPECT_EQ(planned.plan.blocks[0].limit, FeedLimit::force);
  }
}

// With edges, one tooth at 90 deg: |Ktc c + Kte, Krc c + Kre| a = F, a quadratic equation in c.
TEST(FeedPlan, ForceWithEdges) {
  FeedLimits limits = generous();
  limits.force = 150.0;
  const Planned planned = planOf(SLOT, limits, modelText(1, 0.0, 20.0, 25.0));
  const double a = 800e6 * 800e6 + 300e6 * 300e6, b = 800e6 * 20e3 + 300e6 * 25e3,
               c = 20e3 * 20e3 + 25e3 * 25e3 - std::pow(limits.force / (2 * MM), 2);
  const double feed = (-b + std::sqrt(b * b - a * c)) / a * 50.0 / MM_PER_MIN;
  EXPECT_NEAR(feedsOf(planned.moves).at(0), feed, 1.5 * DIGITS * feed);
}

// Torque of one straight tooth R a (Ktc c + Kte); power of a slot Ktc ae ap vf + N a R w Kte / 2; chip and
// feed per tooth of a slot are the same.
TEST(FeedPlan, OtherLimits) {
  FeedLimits limits = generous();
  limits.torque = 0.6;
  double feed = (0.6 / (5 * MM * 2 * MM) - 20e3) / 800e6 * 50.0 / MM_PER_MIN;
  EXPECT_NEAR(feedsOf(planOf(SLOT, limits, modelText(1, 0.0, 20.0, 25.0)).moves).at(0), feed,
              1.5 * DIGITS * feed);
  limits = generous();
  limits.power = 300.0;
  const double edges = 4 * 2 * MM * 5 * MM * (2 * units::PI * 50.0) * 20e3 / 2;
  feed = (300.0 - edges) / (800e6 * 10 * MM * 2 * MM) / MM_PER_MIN;
  EXPECT_NEAR(feedsOf(planOf(SLOT, limits).moves).at(0), feed, 1.5 * DIGITS * feed);
  limits = generous();
  limits.chip = 0.08 * MM;
  EXPECT_NEAR(feedsOf(planOf(SLOT, limits).moves).at(0), 960.0, 1e-6);
  limits.chip = FeedLimits::UNLIMITED;
  limits.feed_per_tooth = 0.07 * MM;
  EXPECT_NEAR(feedsOf(planOf(SLOT, limits).moves).at(0), 840.0, 1e-6);
  limits.machine = 700 * MM_PER_MIN;
  EXPECT_NEAR(feedsOf(planOf(SLOT, limits).moves).at(0), 700.0, 1e-6);
}

// A cut of radial depth e has its largest chip at sin(phi) = 2 sqrt(e / D (1 - e / D)): the feed rises by
// chip thinning.
TEST(FeedPlan, ChipThinning) {
  FeedLimits limits = generous();
  limits.chip = 0.05 * MM;
  const Planned planned = planOf("G21 G90 G0 X-10 Y-4 Z-2\nS3000 M3\nG1 X70 F600\nM30\n", limits);
  const double feed = 0.05 / (2 * std::sqrt(0.1 * 0.9)) * 4 * 3000;
  EXPECT_NEAR(feedsOf(planned.moves).at(0), feed, 2 * DIGITS * feed);
  EXPECT_LE(planned.chip, limits.chip * (1 + 1e-9));
}

// v^2 / r = a on an arc; from rest to rest over s the speed reaches sqrt(a s), in 2 sqrt(s / a).
TEST(FeedPlan, Acceleration) {
  FeedLimits limits = generous();
  limits.acceleration = 1.0;
  const Planned planned = planOf(
      "G21 G90 G0 X70 Y20 Z5\nG3 X70 I4 F9000\nG1 X71\nG0 X-10 Z-2\nS3000 M3\nG1 X70 F600\nM30\n", limits);
  const std::vector<double> feeds = feedsOf(planned.moves);
  const double on_arc = std::sqrt(1.0 * 4 * MM) / MM_PER_MIN;
  EXPECT_NEAR(feeds.at(0), on_arc, 1.2 * DIGITS * on_arc);
  EXPECT_NEAR(feeds.at(1), 20000.0, 1e-6);
  const PlannedBlock& line = planned.plan.blocks.at(1);
  EXPECT_EQ(line.limit, FeedLimit::acceleration);
  EXPECT_NEAR(line.reached, std::sqrt(1.0 * 1 * MM), 1e-9);
  EXPECT_NEAR(line.new_time, 2 * std::sqrt(1 * MM), 1e-9);
  EXPECT_THAT(planSummary(planned.plan, limits), HasSubstr("1 blocks are too short to reach their feed"));
}

// A block has the feed of its worst step; in the program F words alone change, comments and line ends stay.
TEST(FeedPlan, OnlyFeedWordsChange) {
  FeedLimits limits = generous();
  limits.chip = 0.05 * MM;
  limits.machine = 2000 * MM_PER_MIN;
  const std::string text =
      "%\r\nO1 (F12 PART)\r\nN1G21G90G0X-10Y20Z-2\r\nN2S3000M3\r\n N3 G1 X70. f0600. (feed F600) \r\nN4 G0 "
      "Z5 "
      ";F1\r\nN5G1Y21(back)\r\nN6 G1 X-10\r\nN7 F77\r\nN8 G1 X-11\r\nM30\r\n%\r\nF5 behind";
  const Planned planned = planOf(text, limits);
  EXPECT_EQ(
      planned.plan.text,
      "%\r\nO1 (F12 PART)\r\nN1G21G90G0X-10Y20Z-2\r\nN2S3000M3\r\n N3 G1 X70. f0600. (feed F600) \r\nN4 G0 "
      "Z5 ;F1\r\nN5G1Y21F2000(back)\r\nN6 G1 X-10\r\nN7 F77\r\nN8 G1 X-11 F2000\r\nM30\r\n%\r\nF5 behind");
  EXPECT_EQ(planned.plan.changed, 3u);
}

// A subprogram called at two depths, and with the second one in air: one feed that holds in each call. The
// blocks behind it do not inherit its feed.
TEST(FeedPlan, SubprogramHoldsInEachCall) {
  FeedLimits limits = generous();
  limits.force = 300.0;
  const std::string text =
      "G21 G90 S3000 M3\nG0 X-10 Y20 Z-1\nF500\nM98 P5\nG0 X-10 Z-4\nM98 P5\nG0 X-10 Y20 Z5\nM98 P5\nG1 "
      "X-20\nM30\nO5\nG91\nG1 X80\nX1 (out)\nG90\nM99\n";
  const Planned planned = planOf(text, limits);
  const std::vector<double> feeds = feedsOf(planned.moves);
  ASSERT_EQ(feeds.size(), 7u);
  EXPECT_EQ(feeds[0], feeds[2]);
  EXPECT_EQ(feeds[0], feeds[4]);
  EXPECT_NEAR(feeds[1], 20000.0, 1e-6);
  EXPECT_NEAR(feeds[6], 20000.0, 1e-6);
  EXPECT_LE(planned.peak_force, 300.0 * (1 + 1e-9));
  EXPECT_GT(planned.peak_force, 300.0 * 0.998);
  EXPECT_EQ(planned.plan.lines, 3u);
  EXPECT_THAT(planned.plan.text, HasSubstr("G1 X-20\nM30"));  // inherits from X1 (out)
}

// F word in G95 and in inches; a cycle and a ramp into the material keep their feeds, since the end face has
// no force model, also where they inherited them.
TEST(FeedPlan, OtherModes) {
  FeedLimits limits = generous();
  limits.chip = 0.08 * MM;
  const Planned turns = planOf(START + "G95 G1 X70 F0.2\nG94 G0 Z5\nM30\n", limits);
  EXPECT_THAT(turns.plan.text, HasSubstr("G95 G1 X70 F0.32\n"));
  const Planned inches = planOf("G20 G90 G0 X-1 Y0.8 Z-.08\nS3000 M3\nG1 X3 F10\nM30\n", limits);
  EXPECT_THAT(inches.plan.text, HasSubstr("G1 X3 F37.79\n"));  // 960 mm/min = 37.795 in/min
  const Planned cycle =
      planOf(START + "G1 X70 F600\nG0 Z5\nG81 X30 Y5 R1 Z-3\nX40\nG80\nG1 Z4\nM30\n", limits);
  EXPECT_THAT(cycle.plan.text,
              HasSubstr("X70 F960\nG0 Z5\nG81 X30 Y5 R1 Z-3 F600\nX40\nG80\nG1 Z4 F20000\n"));
  const Planned ramp = planOf("G21 G90 G0 X10 Y20 Z1\nS3000 M3\nG1 X50 Z-1 F100\nX10\nM30\n", limits);
  EXPECT_THAT(ramp.plan.text, HasSubstr("Z-1 F100\nX10F960\n"));
}

// An F word of a macro becomes a number that holds for each of its values.
TEST(FeedPlan, Macros) {
  FeedLimits limits = generous();
  limits.chip = 0.08 * MM;
  const std::string text = START +
                           "G65 P2 A70 F300\nG0 Z5\nX-10 Z-3\nG65 P2 A60 F900\nM30\nO2\n#3=FIX[#9/2]\nG1 "
                           "X[#1+0] F[#3*2] (FIX)\nM99\n";
  const Planned planned = planOf(text, limits);
  EXPECT_THAT(planned.plan.text, HasSubstr("O2\n#3=FIX[#9/2]\nG1 X[#1+0] F960 (FIX)\nM99"));
  EXPECT_EQ(planned.plan.changed, 1u);
}

// A feed with more digits than a planned one, kept by a plunge that inherited it.
TEST(FeedPlan, FeedsOfManyDigits) {
  const Planned planned =
      planOf("G21 G90 G95 G0 X-10 Y20 Z-2\nS3000 M3\nG1 X20 F.0333333333\nZ-2.5\nG0 Z5\nM30\n", generous());
  EXPECT_THAT(planned.plan.text, HasSubstr("G1 X20 F4\nZ-2.5F0.0333333333\nG0 Z5"));
}

TEST(FeedPlan, LeastChipIsReported) {
  FeedLimits limits = generous();
  limits.force = 180.0;
  limits.least_chip = 0.1 * MM;
  EXPECT_THAT(planSummary(planOf(SLOT, limits).plan, limits),
              HasSubstr("chip thickness below 0.1 mm in 1 blocks, first in line 3: "));
}

TEST(FeedPlan, OneLineForEachFault) {
  const auto faultOf = [](const std::string& text, const FeedLimits& limits) {
    return errorOf([&] { planOf(text, limits); });
  };
  FeedLimits limits = generous();
  limits.force = 50.0;
  EXPECT_THAT(faultOf(SLOT, limits),
              ::testing::MatchesRegex("part.nc: line 3: G1: the force of the edges alone is "
                                      "[0-9.]+ N at any feed, the limit is 50 N"));
  limits = generous();
  limits.torque = 0.1;
  EXPECT_THAT(faultOf(SLOT, limits), HasSubstr("part.nc: line 3: G1: the torque of the edges alone is "));
  limits = generous();
  limits.power = 10.0;
  EXPECT_THAT(faultOf(SLOT, limits), HasSubstr("part.nc: line 3: G1: the power of the edges alone is "));
  limits = generous();
  limits.force = 0.0;
  EXPECT_EQ(faultOf(SLOT, limits), "limit of the force: 0 is out of range (> 0)");
  limits.force = -5.0;
  EXPECT_EQ(faultOf(SLOT, limits), "limit of the force: -5 is out of range (> 0)");
  limits = generous();
  limits.feed_per_tooth = FeedLimits::UNLIMITED;
  EXPECT_THAT(faultOf(SLOT, limits),
              HasSubstr("without a limit of the chip thickness or the feed per tooth"));
  limits = generous();
  limits.machine = FeedLimits::UNLIMITED;
  EXPECT_THAT(faultOf(SLOT, limits), HasSubstr("without a largest feed of the machine"));
  limits = generous();
  EXPECT_EQ(faultOf(START + "G1 X70 F6(x)00\nM30\n", limits),
            "part.nc: line 3: a comment within the F word, expected it behind the word");
  EXPECT_EQ(faultOf(START + "G94 F600\nM98 P2\nG95 F0.2\nG0 X-10\nM98 P2\nM30\nO2\nG1 X70\nM99\n", limits),
            "part.nc: line 10: G1 is executed in two of G93, G94 and G95, expected one of them");
}

/// Passes with ramps, arcs, air and subprograms; F words, modal or not, at random.
std::string randomProgram(std::mt19937_64& random) {
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto chance = [&](double share) { return uniform(0.0, 1.0) < share; };
  const std::string end = chance(0.5) ? "\r\n" : "\n";
  const auto feed = [&] { return chance(0.4) ? formatted("F%.0f", uniform(100.0, 3000.0)) : std::string(); };
  std::string text = "G21 G90" + end + formatted("S%.0f M3", uniform(2000.0, 6000.0)) + end + "F400" + end;
  const auto block = [&](const std::string& words) {
    const std::string word = feed();
    text += chance(0.3) ? word + (word.empty() ? "" : " ") + words : words + (word.empty() ? "" : " ") + word;
    text += (chance(0.2) ? " (F9 note)" : "") + end;
  };
  for (int level = 1; level <= 2; ++level) {
    text += formatted("G0 Z5%sG0 X-10 Y%.3f%sG0 Z%.3f", end.c_str(), uniform(0.0, 10.0), end.c_str(),
                      -level * uniform(0.5, 1.5)) +
            end;
    for (int pass = 0; pass < 2; ++pass) {
      block(formatted("G1 X%.3f", uniform(20.0, 65.0)));
      block(formatted("Y%.3f", uniform(5.0, 35.0)));
      if (chance(0.5)) block(formatted("G91 G3 X%.3f Y%.3f R12", uniform(-5.0, -1.0), uniform(1.0, 5.0)));
      if (chance(0.4)) text += "M98 P7" + end;
      text += "G90" + end;
      block(formatted("G1 X%.3f Z%.3f", uniform(-10.0, 20.0), -level * uniform(0.8, 1.6)));
    }
  }
  text += "G0 Z5" + end + "M30" + end + "O7" + end + "G91" + end;
  block("G1 X6");
  if (chance(0.5)) block("Y-2");
  return text + "G90" + end + "M99" + end;
}

TEST(FeedPlan, RandomProgramsHoldEveryLimitAndDifferInFeedWordsOnly) {
  std::mt19937_64 random(35);
  for (int i = 0; i < 8; ++i) {
    const std::string text = randomProgram(random);
    FeedLimits limits = generous();
    limits.force = 900.0;
    limits.torque = 3.0;
    limits.power = 600.0;
    limits.chip = 0.12 * MM;
    limits.feed_per_tooth = 0.3 * MM;
    limits.acceleration = 5.0;
    const Planned planned = planOf(text, limits);
    EXPECT_LE(planned.peak_force, limits.force * (1 + 1e-9)) << text;
    EXPECT_LE(planned.peak_torque, limits.torque * (1 + 1e-9)) << text;
    EXPECT_LE(planned.power, limits.power * (1 + 1e-9)) << text;
    EXPECT_LE(planned.chip, limits.chip * (1 + 1e-9)) << text;
    EXPECT_LE(planned.feed_per_tooth, limits.feed_per_tooth * (1 + 1e-9)) << text;
    EXPECT_EQ(withoutFeeds(planned.plan.text), withoutFeeds(text));
    // Every block has the feed of its line, and some limit binds in each.
    for (const PlannedBlock& block : planned.plan.blocks) EXPECT_NE(block.limit, FeedLimit::none) << text;
    // A second plan of the planned program changes nothing.
    EXPECT_EQ(planOf(planned.plan.text, limits).plan.text, planned.plan.text);
  }
}

}  // namespace
}  // namespace smartmill::program
