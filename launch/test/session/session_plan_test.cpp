#include "smartmill_launch/session/session_plan.h"
#include "smartmill_launch/session/control_verdict.h"

#include <cmath>
#include <functional>
#include <map>
#include <sstream>

#include <gmock/gmock.h>
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

TEST(SessionPlan, WithoutAHammerTheStockLimitsTheProbingCuts) {
  PlanParameters parameters;
  parameters.hammer = false;
  const SessionPlan four(mill(), parameters);  // 9 lanes: 4 slots, 4 probing cuts, the recommended one
  ASSERT_EQ(four.planner().lanes(), 9u);
  EXPECT_EQ(four.probingCuts(), 4u);
  EXPECT_FALSE(four.resonance());
  parameters.slot_feeds.pop_back();
  const SessionPlan three(mill(), parameters);
  ASSERT_EQ(three.probingCuts(), 5u);
  const Point point{1000.0, 2.0 * MM};
  const double y = three.slots().back().from[1];
  EXPECT_NEAR(three.probing(0, point, 1e-4).from[1], y + three.planner().laneWidth(), 1e-9);
  EXPECT_NEAR(three.stable(point, 1e-4).from[1], y + 6.0 * three.planner().laneWidth(), 1e-9);
  // 50 revolutions or more, and no feed beyond that of the axes.
  const PlannedCut slow = three.probing(1, {200.0, 2.0 * MM}, 1e-4);
  EXPECT_GE((slow.condition.steady_to[0] - slow.condition.steady_from[0]) / slow.feed,
            50.0 * units::TWO_PI / slow.condition.spindle_speed * 0.999);
  EXPECT_NEAR(three.probing(2, {radPerSecFromRpm(20000.0), 2.0 * MM}, 1e-3).feed, 0.4, 1e-9);
  parameters.lost_lanes = 2;
  EXPECT_EQ(SessionPlan(mill(), parameters).probingCuts(), 3u);
  parameters.lost_lanes = 3;
  EXPECT_THAT(refusal(mill(), parameters),
              ::testing::HasSubstr("3 probing cuts, the recommended cut, 3 cut"));
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

// ----------------------------------------------------------------- cuts of half immersion

PlanParameters informative() {
  PlanParameters parameters;
  parameters.test_cuts = "informative";
  parameters.half_up_depth = 3.0 * MM;
  return parameters;
}

/// The stock after the motions of NC programs below its top; independent of the planner.
class CutStock {
 public:
  explicit CutStock(const MachineModel& model) : box_(*model.workpiece), radius_(model.tool->radius()) {}

  /// Height of the material above the tip at a point of its circumference.
  double heightAt(const std::array<double, 3>& tip, double angle, double share = 1.0) const {
    const double x = tip[0] + share * radius_ * std::sin(angle),
                 y = tip[1] + share * radius_ * std::cos(angle);
    if (x <= box_.low[0] || x >= box_.high[0] || y <= box_.low[1] || y >= box_.high[1]) return 0.0;
    double top = box_.high[2];
    for (const auto& [from, to] : motions_) {
      const double dx = to[0] - from[0], dy = to[1] - from[1], length2 = dx * dx + dy * dy;
      const double along = length2 > 0.0 ? ((x - from[0]) * dx + (y - from[1]) * dy) / length2 : 0.0;
      const double t = std::min(1.0, std::max(0.0, along));
      if (std::hypot(x - from[0] - t * dx, y - from[1] - t * dy) < radius_) top = std::min(top, to[2]);
    }
    return std::max(0.0, top - tip[2]);
  }

  bool isInAir(const std::array<double, 3>& tip) const {
    for (int i = 0; i < 360; ++i) {
      // 0.01 mm inside: the circle touches the side of the strip.
      if (heightAt(tip, units::TWO_PI * i / 360, 1.0 - 1e-3) > 0.0) return false;
    }
    return true;
  }

  /// Entry, exit and depth of the front half of a tool that moves along +x.
  Engagement contact(const std::array<double, 3>& tip) const {
    constexpr int STEPS = 18000;
    Engagement found{NOT_A_NUMBER, NOT_A_NUMBER, 0.0, 0.0};
    for (int i = 0; i < STEPS; ++i) {
      const double angle = units::PI * (i + 0.5) / STEPS, height = heightAt(tip, angle);
      if (height <= 0.0) continue;
      if (std::isnan(found.entry)) found.entry = angle;
      EXPECT_TRUE(found.axial_depth == 0.0 || std::abs(height - found.axial_depth) < 1e-9) << "one depth";
      found.exit = angle;
      found.axial_depth = height;
    }
    return found;
  }

  void remove(const std::array<double, 3>& from, const std::array<double, 3>& to) {
    if (to[2] < box_.high[2]) motions_.push_back({from, to});
  }

 private:
  Workpiece box_;
  double radius_;
  std::vector<std::pair<std::array<double, 3>, std::array<double, 3>>> motions_;
};

/// Runs the program of a cut and compares its contact with its condition, at the increments of the
/// controller.
void runAndCompare(const SessionPlan& plan, const PlannedCut& cut, CutStock& stock) {
  const CuttingCondition& condition = cut.condition;
  const std::array<double, 3> start{0.1234567, -0.0123456, -0.0501234};
  const ToolPath path = toolPathOf(plan.planner().program(cut, start), start);
  std::array<double, 3> last = start;
  bool has_cut = false;
  for (std::size_t i = 0; i < path.points.size(); ++i) {
    const std::array<double, 3>& point = path.points[i];
    const bool feeds_x = path.feeds[i] > 0.0 && point[0] - last[0] > 1e-6;
    if (feeds_x) {
      has_cut = true;
      EXPECT_TRUE(stock.isInAir(last)) << condition.name << " enters from the air";
      for (const double share : {0.0, 0.25, 0.5, 0.75, 1.0}) {
        std::array<double, 3> tip = point;
        tip[0] = condition.steady_from[0] + share * (condition.steady_to[0] - condition.steady_from[0]);
        const Engagement found = stock.contact(tip);
        // 1 um of the controller over a radius of 10 mm, and a step of the scan.
        EXPECT_NEAR(found.entry, condition.engagement.entry, 3e-4) << condition.name << " " << share;
        EXPECT_NEAR(found.exit, condition.engagement.exit, 3e-4) << condition.name << " " << share;
        EXPECT_NEAR(found.axial_depth, condition.engagement.axial_depth, 1e-6) << condition.name;
      }
    } else if (path.feeds[i] > 0.0 && std::abs(point[1] - last[1]) > 1e-6) {
      for (const double share : {0.3, 0.6, 1.0}) {
        const std::array<double, 3> tip{point[0], last[1] + share * (point[1] - last[1]), point[2]};
        EXPECT_TRUE(stock.isInAir(tip)) << condition.name << " leaves into the air";
      }
    }
    stock.remove(last, point);
    last = point;
  }
  EXPECT_TRUE(has_cut);
}

std::size_t indexOf(const SessionPlan& plan, const std::string& name) {
  for (std::size_t i = 0; i < plan.candidates().size(); ++i) {
    if (plan.candidates()[i].condition.name == name) return i;
  }
  ADD_FAILURE() << name;
  return 0;
}

TEST(HalfImmersion, ContactAlongTheProgramsIsThatOfTheConditions) {
  const MachineModel model = mill();
  SessionPlan plan(model, informative());
  ASSERT_EQ(plan.candidates().size(), 12u);
  std::vector<std::size_t> chosen;
  // Shorter and longer paths follow each other on each side.
  for (const char* name : {"half_up_1", "half_up_4", "slot_2", "half_down_3", "half_up_2", "half_down_4"})
    chosen.push_back(indexOf(plan, name));
  std::vector<PlannedCut> cuts = plan.place(chosen);
  EXPECT_DOUBLE_EQ(cuts[0].condition.engagement.exit, 0.5 * units::PI);
  EXPECT_DOUBLE_EQ(cuts[3].condition.engagement.entry, 0.5 * units::PI);
  EXPECT_DOUBLE_EQ(cuts[0].condition.engagement.axial_depth, 3.0 * MM);
  cuts.push_back(plan.stable({radPerSecFromRpm(18000.0), 3e-3, 4e-3, 1000.0}, 1e-4));
  cuts.push_back(plan.unstable({radPerSecFromRpm(16000.0), 4e-3, 2e-3, 1000.0}, 1e-4));
  cuts.push_back(*plan.resonance());
  CutStock stock(model);
  for (const PlannedCut& cut : cuts) runAndCompare(plan, cut, stock);
}

TEST(HalfImmersion, CandidatesAreOfferedUntilTheStockIsUsed) {
  const MachineModel model = mill();
  SessionPlan plan(model, informative());
  EXPECT_EQ(plan.available().size(), 12u);
  // 200 mm less a margin of 2 mm and three lanes of 22 mm for the verifying cuts.
  EXPECT_NEAR(plan.freeStock(), (200.0 - 2.0 - 3 * 22.0) * MM, 1e-9);
  EXPECT_NEAR(plan.stockOf(indexOf(plan, "slot_1")), 22.0 * MM, 1e-9);
  EXPECT_NEAR(plan.stockOf(indexOf(plan, "half_down_1")), 10.0 * MM, 1e-9);
  const double time = plan.candidates()[indexOf(plan, "slot_4")].cuttingTime();
  const PlannedCut& half = plan.candidates()[indexOf(plan, "half_up_4")];
  // Sideways by the radius and the clearance, at the plunge feed of 20 mm/s.
  EXPECT_NEAR(half.cuttingTime() - time, (10.0 + 2.0) / 20.0, 1e-9);
  EXPECT_NEAR(half.duration() - half.spin_up, half.cuttingTime(), 1e-12);
  plan.place({indexOf(plan, "half_up_1"), indexOf(plan, "slot_3"), indexOf(plan, "half_down_1")});
  EXPECT_EQ(plan.available().size(), 3u) << "the slots that are left";
  EXPECT_NEAR(plan.freeStock(), (200.0 - 2.0 - 3 * 22.0 - 22.0 - 2 * 10.0) * MM, 1e-9);
  // Slots chosen later have their own lanes.
  const auto later = plan.place({indexOf(plan, "slot_1")});
  EXPECT_NEAR(later.front().from[1], (-100.0 + 10.0 + 2.0 + 10.0 + 4 * 22.0) * MM, 1e-9);
  EXPECT_THAT(errorOf([&] {
                SessionPlan full(model, informative());
                std::vector<std::size_t> all(12);
                for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
                full.place(all);
              }),
              ::testing::HasSubstr("is free"));
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

// Programmed: 1000 rad/s and 0.08 m/s. The control reduces both by a tenth at 0.5 s; a revolution takes
// 7 ms then, so that windows lie wholly after the change from 0.7 s on.
TEST(ControlVerdict, SeparatesTheWindowsByTheChangeOfTheOverrides) {
  const auto windows = [](double until) {
    std::vector<ChatterWindow> all;
    for (int k = 1; k <= 20; ++k) {
      const double stamp = 0.1 * k;
      const bool chatters = stamp >= 0.25 && stamp < until;
      all.push_back({chatters, chatters ? 1234.0 : NOT_A_NUMBER, 10.0, stamp});
    }
    return all;
  };
  const auto states = [](double ratio) {
    std::vector<CutState> all;
    for (int k = 0; k < 100; ++k) {
      const double now = k < 25 ? 1.0 : ratio;
      all.push_back({0.02 * k, 1000.0 * now, 0.08 * now});
    }
    return all;
  };
  const ControlVerdict ended = controlVerdict(windows(0.65), states(0.9), 1000.0, 0.08);
  EXPECT_TRUE(ended.suppressed()) << ended.text();
  EXPECT_NEAR(ended.duration, 0.48 - 0.3, 1e-9);  // last state before the change, end of the first window
  EXPECT_NEAR(ended.speed_ratio, 0.9, 1e-12);
  EXPECT_NEAR(ended.feed_ratio, 0.9, 1e-12);
  EXPECT_DOUBLE_EQ(ended.frequency, 1234.0);
  EXPECT_EQ(ended.after.chattering, 0U);

  EXPECT_FALSE(controlVerdict(windows(3.0), states(0.9), 1000.0, 0.08).suppressed());
  const ControlVerdict ignored = controlVerdict(windows(3.0), states(1.0), 1000.0, 0.08);
  EXPECT_FALSE(ignored.suppressed());
  EXPECT_NE(ignored.text().find("no override followed"), std::string::npos);
  EXPECT_NE(controlVerdict(windows(0.0), states(1.0), 1000.0, 0.08).text().find("no chatter"),
            std::string::npos);
  EXPECT_FALSE(controlVerdict({}, {}, 1000.0, 0.08).suppressed());
}

}  // namespace
}  // namespace smartmill::session
