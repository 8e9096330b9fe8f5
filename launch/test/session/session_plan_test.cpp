#include "smartmill_launch/session/session_plan.h"

#include <cmath>
#include <functional>
#include <map>
#include <sstream>

#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"

namespace smartmill::session {
namespace {

using units::MM;
using units::radPerSecFromRpm;

/// A 4-tooth 20 mm tool over a stock of 300 x 200 x 40 mm.
MachineModel mill() {
  MachineModel model;
  model.file = "mill.yaml";
  model.tool = ToolGeometry{4, 20.0 * MM, 0.5, {}};
  model.spindle.emplace();
  model.spindle->max_speed = radPerSecFromRpm(20000.0);
  model.spindle->acceleration = radPerSecFromRpm(10000.0);
  model.axes.emplace();
  model.axes->travel = {{{-0.3, 0.3}, {-0.2, 0.2}, {-0.3, 0.0}}};
  model.axes->rapid = 0.4;
  model.workpiece = Workpiece{"al7050", {-0.15, -0.10, -0.20}, {0.15, 0.10, -0.16}};
  return model;
}

std::string refusal(const MachineModel& model, const PlanParameters& parameters) {
  return errorOf([&] { SessionPlan(model, parameters); });
}

/// Path of the tool in an incremental NC program.
struct ToolPath {
  std::vector<std::array<double, 3>> points;  // [m] after each block with motion
  std::vector<double> feeds;                  // [m/s] to each point, 0: rapid
  double dwell = 0.0;                         // [s]
  double speed = 0.0;                         // [rpm] of the last S
  bool stopped = false;                       // M5 at the end
};

ToolPath toolPathOf(const std::string& program, std::array<double, 3> at) {
  ToolPath out;
  std::istringstream lines(program);
  std::string line;
  while (std::getline(lines, line)) {
    if (line.rfind("(", 0) == 0) continue;
    std::map<char, double> words;
    std::istringstream text(line);
    for (std::string word; text >> word;) words[word[0]] = std::stod(word.substr(1));
    if (words.count('S')) out.speed = words['S'];
    if (words.count('P')) out.dwell += words['P'] / 1000.0;
    out.stopped = line == "M5";
    bool moved = false;
    for (int axis = 0; axis < 3; ++axis) {
      if (!words.count("XYZ"[axis])) continue;
      at[static_cast<std::size_t>(axis)] += words["XYZ"[axis]] * MM;
      moved = true;
    }
    if (!moved) continue;
    out.points.push_back(at);
    out.feeds.push_back(words.count('F') ? words['F'] * MM / 60.0 : 0.0);
  }
  return out;
}

TEST(SessionPlan, FeedIsFeedPerToothTimesTeethTimesSpeed) {
  PlanParameters parameters;
  parameters.slot_speed = radPerSecFromRpm(4000.0);
  const SessionPlan plan(mill(), parameters);
  ASSERT_EQ(plan.slots().size(), 4u);
  // 0.05 mm x 4 teeth x 4000 / 60 = 13.333 mm/s
  EXPECT_NEAR(plan.slots()[0].feed, 13.3333e-3, 1e-6);
  EXPECT_NEAR(plan.slots()[3].feed, 4.0 * plan.slots()[0].feed, 1e-12);
  for (const PlannedCut& slot : plan.slots()) {
    EXPECT_DOUBLE_EQ(slot.condition.engagement.axial_depth, parameters.slot_depth);
    EXPECT_DOUBLE_EQ(slot.condition.engagement.exit, units::PI);
    EXPECT_EQ(slot.condition.material, "al7050");
    EXPECT_EQ(slot.condition.kind, CuttingCondition::Kind::cut);
  }
}

TEST(SessionPlan, TheSteadySegmentIsFullyEngaged) {
  const MachineModel model = mill();
  const SessionPlan plan(model, PlanParameters());
  const double radius = model.tool->radius();
  std::vector<PlannedCut> cuts = plan.slots();
  cuts.push_back(*plan.resonance());
  cuts.push_back(plan.stable({radPerSecFromRpm(18000.0), 3e-3, 4e-3, 1000.0}, 1e-4));
  cuts.push_back(plan.unstable({radPerSecFromRpm(16000.0), 4e-3, 2e-3, 1000.0}, 1e-4));
  for (const PlannedCut& cut : cuts) {
    const auto& from = cut.condition.steady_from;
    const auto& to = cut.condition.steady_to;
    // The front half of the tool is in the stock, advanced by the feed of a revolution: every tooth has cut.
    EXPECT_GE(from[0] - radius, model.workpiece->low[0]) << cut.condition.name;
    EXPECT_LE(to[0] + radius, model.workpiece->high[0]) << cut.condition.name;
    EXPECT_GT(to[0], from[0]);
    EXPECT_EQ(from[1], to[1]);
    EXPECT_NEAR(from[2], model.workpiece->high[2] - cut.condition.engagement.axial_depth, 1e-12);
    // The tool descends before the stock and moves on beyond the steady segment.
    EXPECT_LT(cut.from[0] + radius, model.workpiece->low[0]);
    EXPECT_GT(cut.to[0], to[0]);
  }
}

TEST(SessionPlan, LanesAreSeparateFullSlots) {
  const MachineModel model = mill();
  const SessionPlan plan(model, PlanParameters());
  std::vector<PlannedCut> cuts = plan.slots();
  cuts.push_back(plan.stable({1000.0, 1e-3, 2e-3, 1.0}, 1e-4));
  cuts.push_back(plan.unstable({1000.0, 1e-3, 2e-3, 1.0}, 1e-4));
  cuts.push_back(*plan.resonance());
  const double diameter = model.tool->diameter;
  for (std::size_t i = 0; i < cuts.size(); ++i) {
    EXPECT_GE(cuts[i].from[1] - 0.5 * diameter, model.workpiece->low[1]);
    EXPECT_LE(cuts[i].from[1] + 0.5 * diameter, model.workpiece->high[1]);
    for (std::size_t k = 0; k < i; ++k)
      EXPECT_GE(std::abs(cuts[i].from[1] - cuts[k].from[1]), diameter + 1e-3);
  }
}

TEST(SessionPlan, ProgramEndsAtThePlannedPointWithoutAccumulatedRounding) {
  const SessionPlan plan(mill(), PlanParameters());
  // The start is no multiple of the controller increment of 1 um.
  const std::array<double, 3> start{0.1234567, -0.0123456, -0.0501234};
  for (const PlannedCut& cut : plan.slots()) {
    const ToolPath path = toolPathOf(plan.planner().program(cut, start), start);
    ASSERT_FALSE(path.points.empty());
    const double safe = -0.16 + PlanParameters().safe_height;
    for (std::size_t axis = 0; axis < 2; ++axis) EXPECT_NEAR(path.points.back()[axis], cut.to[axis], 0.6e-6);
    EXPECT_NEAR(path.points.back()[2], safe, 0.6e-6);
    // Lateral motion only above the stock, except for the cut; descent with the plunge feed.
    std::array<double, 3> last = start;
    for (std::size_t i = 0; i < path.points.size(); ++i) {
      const auto& point = path.points[i];
      const bool lateral = std::abs(point[0] - last[0]) + std::abs(point[1] - last[1]) > 1e-9;
      if (lateral && std::min(point[2], last[2]) < safe - 1e-6) {
        EXPECT_NEAR(path.feeds[i], cut.feed, 1e-8);
      } else if (point[2] < last[2] && point[2] < safe - 1e-6) {
        EXPECT_NEAR(path.feeds[i], PlanParameters().plunge_feed, 1e-8);
      }
      last = point;
    }
    EXPECT_DOUBLE_EQ(path.speed, 4000.0);
    // 0.4 s to 4000 rpm at 10000 rpm/s.
    EXPECT_GE(path.dwell, 0.4);
    EXPECT_TRUE(path.stopped);
  }
}

TEST(SessionPlan, ALowToolIsLiftedBeforeLateralMotion) {
  const SessionPlan plan(mill(), PlanParameters());
  const std::array<double, 3> low{0.2, 0.0, -0.19};
  const ToolPath path = toolPathOf(plan.planner().program(plan.slots()[0], low), low);
  EXPECT_EQ(path.points[0][0], low[0]);
  EXPECT_NEAR(path.points[0][2], -0.15, 1e-6);
}

TEST(SessionPlan, AirCutsHaveIntegerRpm) {
  PlanParameters parameters;
  const SessionPlan plan(mill(), parameters);
  ASSERT_EQ(plan.airCuts().size(), parameters.air_speeds.size());
  const PlannedCut& air = plan.airCuts()[0];
  EXPECT_NEAR(units::rpmFromRadPerSec(air.condition.spindle_speed), 3000.0, 1e-9);
  const ToolPath path = toolPathOf(plan.planner().program(air, {0, 0, 0}), {0, 0, 0});
  EXPECT_TRUE(path.points.empty());
  EXPECT_NEAR(path.dwell, air.spin_up + parameters.air_time, 1e-3);
  EXPECT_NEAR(air.duration(), path.dwell, 1e-3);
}

TEST(SessionPlan, ChoosesTheFirstPointThatFits) {
  const SessionPlan plan(mill(), PlanParameters());
  std::string reasons;
  const Point too_fast{radPerSecFromRpm(25000.0), 1e-3, 2e-3, 1.0},
      too_deep{radPerSecFromRpm(9000.0), 0.05, 0.06, 1.0};
  const Point fits{radPerSecFromRpm(9000.0), 2e-3, 3e-3, 1.0};
  const auto chosen = plan.firstStable({too_fast, too_deep, fits}, 1e-4, reasons);
  ASSERT_TRUE(chosen);
  EXPECT_DOUBLE_EQ(chosen->axial_depth, 2e-3);
  EXPECT_NE(reasons.find("25000 rpm"), std::string::npos);
  reasons.clear();
  EXPECT_FALSE(plan.firstUnstable({too_fast, too_deep}, 1e-4, reasons));
  EXPECT_NE(reasons.find("; "), std::string::npos);
}

TEST(SessionPlan, RefusesCutsThatDoNotFitInOneLine) {
  PlanParameters parameters;
  MachineModel model = mill();
  parameters.slot_feeds.assign(12, 1e-4);
  EXPECT_NE(refusal(model, parameters).find("expected 15"), std::string::npos) << refusal(model, parameters);
  parameters = PlanParameters();
  parameters.slot_speed = radPerSecFromRpm(20500.0);
  EXPECT_NE(refusal(model, parameters).find("20500 rpm"), std::string::npos);
  parameters = PlanParameters();
  parameters.slot_depth = 0.041;
  EXPECT_NE(refusal(model, parameters).find("41.00 mm"), std::string::npos);
  parameters = PlanParameters();
  parameters.slot_feeds[3] = 3e-3;  // 4 teeth x 3 mm x 66.7 / s = 0.8 m/s
  EXPECT_NE(refusal(model, parameters).find("48000.0 mm/min"), std::string::npos)
      << refusal(model, parameters);
  parameters = PlanParameters();
  parameters.slot_feeds[3] = 1e-3;  // 267 mm/s: the stock's 260 mm last less than a second
  parameters.least_slot_time = 1.5;
  EXPECT_NE(refusal(model, parameters).find("expected at least 1.50 s"), std::string::npos)
      << refusal(model, parameters);
  parameters = PlanParameters();
  model.axes->travel[0][0] = -0.16;
  EXPECT_NE(refusal(model, parameters).find("beyond the machine's travel"), std::string::npos);
  model = mill();
  model.workpiece.reset();
  EXPECT_NE(refusal(model, parameters).find("workpiece is missing"), std::string::npos);
}

TEST(PlanParameters, RefusesTooFewSpeedsAndFeedsAndValuesNotAboveZero) {
  const auto check = [](const std::function<void(PlanParameters&)>& change) {
    PlanParameters parameters;
    change(parameters);
    return errorOf([&] { parameters.validate(); });
  };
  EXPECT_EQ(check([](PlanParameters&) {}), "");
  EXPECT_NE(check([](PlanParameters& p) { p.air_speeds.resize(3); }).find("4 or more"), std::string::npos);
  EXPECT_NE(check([](PlanParameters& p) { p.slot_feeds.resize(2); }).find("3 or more"), std::string::npos);
  EXPECT_NE(check([](PlanParameters& p) { p.plunge_feed = 0.0; }).find("plunge_feed"), std::string::npos);
  EXPECT_NE(check([](PlanParameters& p) { p.slot_time = NOT_A_NUMBER; }).find("slot_time"),
            std::string::npos);
}

TEST(CutVerdict, StableToATenthChatterFromHalfUnknownForFewWindows) {
  const auto windows = [](int chatter, int all) {
    std::vector<ChatterWindow> out;
    for (int i = 0; i < all; ++i)
      out.push_back({i < chatter, i < chatter ? 800.0 + i : NOT_A_NUMBER, 1.0 * i});
    return out;
  };
  EXPECT_EQ(cutVerdict({}).kind, CutVerdict::Kind::unknown);
  EXPECT_EQ(cutVerdict(windows(1, 1)).kind, CutVerdict::Kind::unknown);
  EXPECT_EQ(cutVerdict(windows(1, 10)).kind, CutVerdict::Kind::stable);
  EXPECT_EQ(cutVerdict(windows(2, 10)).kind, CutVerdict::Kind::undecided);
  const CutVerdict chatter = cutVerdict(windows(5, 10));
  EXPECT_EQ(chatter.kind, CutVerdict::Kind::chatter);
  EXPECT_DOUBLE_EQ(chatter.frequency, 802.0);  // median of 800..804
  EXPECT_DOUBLE_EQ(chatter.severity, 9.0);
  EXPECT_NE(chatter.text().find("5 of 10"), std::string::npos);
}

}  // namespace
}  // namespace smartmill::session
