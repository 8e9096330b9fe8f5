// Spindle speeds against closed forms of a tool with one mode.

#include "smartmill_program/plan/speed_planner.h"

#include <cmath>

#include <gmock/gmock.h>

#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_program/plan/feed_planner.h"
#include "smartmill_program/plan/plan_report.h"
#include "smartmill_program/prediction/stability_limits.h"

namespace smartmill::program {
namespace {

using ::testing::HasSubstr;
using units::MM;
using units::PI;
using units::radPerSecFromRpm;
using units::rpmFromRadPerSec;

constexpr double MODE = 900.0;            // [Hz]
constexpr double MM_PER_MIN = MM / 60.0;  // [m/s]
constexpr const char* MILL = R"(format: smartmill-model/1
tool: {teeth: 4, diameter_mm: 10.0, helix_deg: 0}
cutting: {Ktc_n_per_mm2: 800.0, Krc_n_per_mm2: 300.0, Kac_n_per_mm2: 200.0, Kte_n_per_mm: 20, Kre_n_per_mm: 25, Kae_n_per_mm: 3.0}
)";
constexpr const char* MODES = R"(tool_tip:
  x: [{frequency_hz: 900, damping_ratio: 0.03, stiffness_n_per_um: 20}]
  y: [{frequency_hz: 900, damping_ratio: 0.03, stiffness_n_per_um: 20}]
)";

/// A ramp into the slot, the slot, and a cut of half the diameter.
constexpr const char* PART =
    "G21 G90 G0 X5 Y20 Z1\n"
    "S3000 M3\n"
    "G1 Z-1.5 F100\n"  // 3
    "G1 X60 F600\n"    // 4
    "G0 Z5\n"
    "G0 X-10 Y25\n"
    "G0 Z-1\n"
    "G1 X70 F500\n"  // 8
    "M30\n";

struct SpeedPlan {
  std::vector<PlannedSpeed> speeds;
  std::string text;
  FeedPlan feeds;
  std::vector<Move> moves;  // of the plan
};

SpeedPlan planOf(const std::string& text, const std::string& model, double low_rpm, double high_rpm) {
  const TemporaryFolder folder;
  ToolModels models({folder.write("mill.yaml", model)});
  const Stock stock(StockBlock{{0, 0, -10 * MM}, {60 * MM, 40 * MM, 0}}, 0.2 * MM);
  SpeedLimits limits;
  limits.low = radPerSecFromRpm(low_rpm);
  limits.high = radPerSecFromRpm(high_rpm);
  SpeedPlanner planner(models, limits);
  const std::vector<Move> moves = interpretProgram(text, "part.nc");
  AnalysisOptions options;
  options.stability = false;
  Stock cut = stock;
  const AnalysisResult before =
      ProgramAnalysis("part.nc", models, cut, options)
          .run(moves, [&](const Step& step, const StepPrediction&) { planner.add(step); });
  SpeedPlan plan;
  plan.speeds = planner.plan();
  const SpeedText changed = withSpeeds(text, plan.speeds);
  plan.text = changed.text;
  FeedLimits feeds;
  feeds.feed_per_tooth = 0.05 * MM;
  feeds.machine = 20000 * MM_PER_MIN;
  FeedPlanner feed_planner("part.nc", changed.text, {}, models, feeds, changed.ratios);
  const std::vector<Move> at_speeds = interpretProgram(changed.text, "part.nc");
  Stock again = stock;
  const AnalysisResult analysis =
      ProgramAnalysis("part.nc", models, again, options)
          .run(at_speeds, [&](const Step& step, const StepPrediction&) { feed_planner.add(step); });
  plan.feeds = feed_planner.plan({at_speeds, analysis}, {moves, before}, stock, options);
  plan.moves = interpretProgram(plan.feeds.text, "planned.nc");
  return plan;
}

double feedOfLine(const std::vector<Move>& moves, int line) {
  for (const Move& move : moves)
    if (move.line == line && !move.rapid) return move.feed / MM_PER_MIN;
  return NAN;
}

// The pockets of a mode are at tooth passing frequencies of f / k: 13500, 6750, 4500 rpm.
TEST(SpeedPlan, IsInThePocketOfTheMode) {
  const SpeedPlan plan = planOf(PART, std::string(MILL) + MODES, 4000.0, 9000.0);
  ASSERT_EQ(plan.speeds.size(), 1u);
  const PlannedSpeed& speed = plan.speeds[0];
  EXPECT_EQ(speed.line, 2);
  ASSERT_TRUE(speed.new_speed);
  EXPECT_NEAR(rpmFromRadPerSec(*speed.new_speed), 60.0 * MODE / (4 * 2), 0.06 * 6750.0);
  EXPECT_LE(*speed.probability, 0.05);
  EXPECT_THAT(speedSummary(plan.speeds), HasSubstr("speed of line 2 (T0): 3000 rpm before, "));
  EXPECT_EQ(plan.moves.front().spindle_speed, plan.moves.back().spindle_speed);
  // At the old speed and between the pockets the slot chatters.
  const TemporaryFolder folder;
  const MachineModel model = readMachineModel(folder.write("mill.yaml", std::string(MILL) + MODES));
  StabilityLimits limits(model);
  const EngagementCell slot = EngagementCell::of(Contact{{{0.0, PI, 1.5 * MM}}}, 0.0, false);
  EXPECT_GT(limits.limit(slot, *speed.new_speed), 1.5 * MM);
  for (const double rpm : {7600.0, 8300.0, 9000.0})
    EXPECT_LT(limits.limit(slot, radPerSecFromRpm(rpm)), 1.5 * MM);
}

// Feed per tooth: that of the limit in the slot; in the ramp, which has no force model, that of the program.
TEST(SpeedPlan, FeedsFollowTheSpeed) {
  const SpeedPlan plan = planOf(PART, std::string(MILL) + MODES, 4000.0, 9000.0);
  const double rpm = rpmFromRadPerSec(*plan.speeds[0].new_speed);
  EXPECT_NEAR(feedOfLine(plan.moves, 4), 0.05 * 4 * rpm, 1e-3 * 0.05 * 4 * rpm);
  EXPECT_NEAR(feedOfLine(plan.moves, 3), 100.0 * rpm / 3000.0, 1e-3 * 100.0 * rpm / 3000.0);
  const auto& slot = plan.feeds.blocks.at(1);
  EXPECT_NEAR(rpmFromRadPerSec(slot.old_speed), 3000.0, 1e-6);
  EXPECT_NEAR(rpmFromRadPerSec(slot.new_speed), rpm, 1e-6);
  // A feed per revolution follows by itself.
  std::string per_revolution = PART;
  per_revolution.replace(per_revolution.find("F100"), 4, "G95 F0.0333");
  per_revolution.replace(per_revolution.find("F600"), 4, "F0.2");
  per_revolution.replace(per_revolution.find("F500"), 4, "F0.16");
  const SpeedPlan other = planOf(per_revolution, std::string(MILL) + MODES, 4000.0, 9000.0);
  EXPECT_NEAR(feedOfLine(other.moves, 3), 0.0333 * rpm, 1e-3 * 0.0333 * rpm);
  EXPECT_NEAR(feedOfLine(other.moves, 4), 0.2 * rpm, 1e-3 * 0.2 * rpm);
}

TEST(SpeedPlan, KeepsTheSWordAndSaysWhy) {
  const auto reason = [](const std::string& text, const std::string& model, double low, double high) {
    const SpeedPlan plan = planOf(text, model, low, high);
    EXPECT_FALSE(plan.speeds.at(0).new_speed);
    EXPECT_EQ(plan.text, text);
    return plan.speeds.at(0).reason;
  };
  const std::string flexible = std::string(MILL) + MODES;
  EXPECT_EQ(reason(PART, MILL, 4000, 9000), "the model of the tool states no modes");
  EXPECT_EQ(reason(PART, flexible, 7600, 9000),
            "no speed of 7600 to 9000 rpm chatters with a probability of 0.05 or less");
  const std::string spindle =
      "spindle: {viscous_nm_s_per_rad: 1e-4, coulomb_nm: 0, load_meter_v_per_w: 1e-3, "
      "load_meter_bandwidth_hz: 7, "
      "load_meter_resolution_v: 1e-3, max_speed_rpm: 5500}\n";
  EXPECT_EQ(reason(PART, flexible + spindle, 5000, 9000),
            "no speed of 5000 to 5500 rpm chatters with a probability of 0.05 or less");
  const std::string twice =
      "G21 G90 G0 X-10 Y20 Z-1\n#1=3000\nM98 P2\n#1=4000\nG0 Y5\nM98 P2\nM30\nO2\nS#100 M3\nG1 "
      "X70 F600\nG0 Z5\nG0 X-10\nG0 Z-1\nM99\n";
  std::string called = twice;
  for (std::size_t at; (at = called.find("#1=")) != std::string::npos;) called.replace(at, 3, "#100=");
  EXPECT_EQ(reason(called, flexible, 4000, 9000), "it is executed with several tools or speeds");
}

TEST(SpeedPlan, RefusesAnEmptyRange) {
  const TemporaryFolder folder;
  ToolModels models({folder.write("mill.yaml", MILL)});
  SpeedLimits limits;
  limits.low = radPerSecFromRpm(9000);
  limits.high = radPerSecFromRpm(4000);
  EXPECT_EQ(errorOf([&] { SpeedPlanner(models, limits); }),
            "speeds of 9000 to 4000 rpm: expected 0 < low <= high");
}

// With an uncertain Kt and without Kr the limit is in inverse proportion to Kt, which is log-normal:
// P = Phi(ln(depth / limit) / deviation).
TEST(ChatterRisk, IsThatOfTheLogNormalCoefficient) {
  MachineModel model = mill(4, 0.0);
  model.cutting->krc = 0.0;
  ModalModel mode;
  mode.modes.emplace_back();
  mode.modes.back().frequency = MODE;
  mode.modes.back().damping_ratio = 0.03;
  mode.modes.back().gain = 1.0 / 2e7;
  model.tool_tip.x = model.tool_tip.y = mode;
  model.uncertainty = {10.0, 0.0, 0.0, 0.0, 0.0};
  stability::RiskOptions options;
  options.risk = 1.0;
  options.draws = 400;
  options.speed_margin = 0.0;
  const EngagementCell slot = EngagementCell::of(Contact{{{0.0, PI, 1.0 * MM}}}, 0.0, false);
  const double speed = radPerSecFromRpm(5000.0), limit = StabilityLimits(model).limit(slot, speed);
  ChatterRisk risk(model, options);
  for (const double deviations : {-2.0, -1.0, 0.0, 1.0, 2.0}) {
    const double expected = 0.5 * std::erfc(-deviations / std::sqrt(2.0));
    const double scatter = std::sqrt(expected * (1.0 - expected) / options.draws);
    const double depth = limit * std::exp(0.1 * deviations);
    EXPECT_NEAR(*risk.probability(slot, speed, depth), expected, 3.0 * scatter + 0.03) << deviations;
    if (deviations != 0.0) {
      EXPECT_EQ(risk.meanIsStable(slot, speed, depth), deviations < 0.0);
    }
  }
  EXPECT_EQ(risk.rounded(slot, speed, 0.2 * limit), 0.0);
  EXPECT_EQ(risk.rounded(slot, speed, 5.0 * limit), 1.0);
}

}  // namespace
}  // namespace smartmill::program
