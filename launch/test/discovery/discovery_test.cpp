#include <cmath>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "session/child.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/effect_catalogue.h"
#include "smartmill_core/testing/shipped_parameters.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_launch/discovery/discovery_parameters.h"
#include "smartmill_launch/discovery/discovery_report.h"
#include "smartmill_launch/discovery/explained.h"
#include "smartmill_launch/discovery/installed_model.h"

namespace smartmill::discovery {
namespace {

namespace fs = std::filesystem;

const char* const REPORT = R"({"format": "smartmill-report/1", "verdict": "explained", "where": [],
 "effects": [{"name": "runout", "parameters": {"offset_um": {"value": 9.02, "std": 0.02},
                                               "angle_deg": {"value": 359.0, "std": 1.0}}},
             {"name": "gain_error", "parameters": {"gain": {"value": 1.1, "std": 0.01},
                                                   "channel": {"value": "fx"}}}],
 "not_separable": [["runout", "tooth_radius"]],
 "suggested_test": "a cut at 7200 rpm",
 "suggested_cut": {"kind": "cut", "spindle_speed_rpm": 7200.0, "feed_per_tooth_mm": 0.2, "axial_depth_mm": 3.0,
                   "entry_deg": 0.0, "exit_deg": 180.0},
 "unexplained": [], "gap": {"before": {"fit": 20.0, "heldout": 21.0}, "after": {"fit": 1.0, "heldout": 1.01}}})";

std::string written(const TemporaryFolder& folder, const std::string& name, const std::string& text) {
  const std::string file = folder.file(name);
  std::ofstream(file) << text;
  return file;
}

std::string contentOf(const std::string& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

MachineModel machine() {
  MachineModel m;
  m.file = "mill.yaml";
  m.tool = ToolGeometry{4, 12e-3, units::radFromDeg(35.0), {}};
  m.spindle = Spindle{};
  m.spindle->max_speed = units::radPerSecFromRpm(10000.0);
  m.axes = MachineAxes{};
  m.axes->travel = {{{{-0.25, 0.25}}, {{-0.2, 0.2}}, {{-0.3, 0.0}}}};
  m.axes->rapid = 0.4;
  m.workpiece = Workpiece{};
  m.workpiece->low = {-0.14, -0.06, -0.2};
  m.workpiece->high = {0.14, 0.06, -0.16};
  return m;
}

TEST(Explained, isReadFromTheReport) {
  const TemporaryFolder folder;
  const Explained e = readExplained(written(folder, "report.json", REPORT));
  EXPECT_EQ(e.verdict, "explained");
  ASSERT_EQ(e.effects.size(), 2u);
  EXPECT_EQ(e.effects[0].text(), "runout: offset_um 9.02 +- 0.02, angle_deg 359 +- 1");
  EXPECT_EQ(e.effects[1].text(), "gain_error: gain 1.1 +- 0.01, channel fx");
  EXPECT_EQ(e.rivals, std::vector<std::string>{"runout or tooth_radius"});
  ASSERT_TRUE(e.suggested_test);
  EXPECT_TRUE(e.suggested_test->cut);
  EXPECT_NEAR(e.suggested_test->speed, 753.98, 0.01);
  EXPECT_NEAR(e.suggested_test->engagement.axial_depth, 3e-3, 1e-12);
  EXPECT_DOUBLE_EQ(e.gap_before, 21.0);
  EXPECT_DOUBLE_EQ(e.gap_after, 1.01);
  EXPECT_TRUE(e.better);
  EXPECT_THROW(readExplained(folder.file("none.json")), Error);
  EXPECT_THROW(readExplained(written(folder, "cut.json", "{\"verdict\": ")), Error);
}

TEST(Explained, aSuggestedTestMustFitMachineAndStock) {
  const TemporaryFolder folder;
  const session::CutPlanner planner(machine(), {});
  const Explained::SuggestedTest suggested_test =
      *readExplained(written(folder, "report.json", REPORT)).suggested_test;
  const DiscoveryParameters p;
  const session::PlannedCut cut =
      planSuggestedTest(planner, suggested_test, p.slotRequest("suggested", 2), 1.0);
  EXPECT_EQ(cut.condition.name, "suggested");
  EXPECT_NEAR(cut.condition.engagement.axial_depth, 3e-3, 1e-12);
  EXPECT_NEAR(cut.from[2], -0.163, 1e-12);
  EXPECT_NEAR(cut.from[1], -0.06 + 2e-3 + 6e-3 + 2 * 14e-3, 1e-12);
  const auto refused = [&](auto change, std::size_t lane, const std::string& why) {
    Explained::SuggestedTest other = suggested_test;
    change(other);
    try {
      planSuggestedTest(planner, other, p.slotRequest("suggested", lane), 1.0);
      ADD_FAILURE() << why;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(why), std::string::npos) << error.what();
    }
  };
  refused([](auto& w) { w.speed = 1100.0; }, 2,
          "10504 rpm, the maximum speed of the spindle of mill.yaml is 10000 rpm");
  refused([](auto& w) { w.engagement.axial_depth = 0.05; }, 2,
          "a depth of 50.00 mm, the height of the stock is 40.00 mm");
  refused([](auto& w) { w.engagement.exit = 1.0; }, 2, "from 0 to 57 deg, expected a full slot");
  refused([](auto& w) { w.engagement.feed_per_tooth = 2e-3; }, 2, "a feed of 57600.0 mm/min");
  refused([](auto&) {}, 8, "has space for 8 slots of 12.00 mm, expected 9");
  Explained::SuggestedTest air;
  air.speed = 500.0;
  EXPECT_EQ(planSuggestedTest(planner, air, p.slotRequest("suggested", 9), 1.0).feed, 0.0);
}

// Limits of 8 and 2 mm at 4000 and 4050 rpm, stable to the largest depth at 7200 rpm.
TEST(BelievedLimits, CutsStayInsideTheirShareOfTheLimit) {
  const TemporaryFolder folder;
  const BelievedLimits limits(written(folder, "chart.csv",
                                      "rpm,limit_mm,chatter_hz,kind\n4000,8,1200,hopf\n4050,2,1210,hopf\n"
                                      "7200,,,\n"),
                              0.5);
  EXPECT_NEAR(limits.depthAt(units::radPerSecFromRpm(4000.0)), 1e-3, 1e-12);  // both are within 2 %
  EXPECT_NEAR(limits.depthAt(units::radPerSecFromRpm(3950.0)), 4e-3, 1e-12);
  EXPECT_TRUE(std::isinf(limits.depthAt(units::radPerSecFromRpm(7200.0))));
  EXPECT_TRUE(std::isinf(BelievedLimits().depthAt(400.0)));
  EXPECT_THROW(BelievedLimits(written(folder, "no_chart.csv", "speed,depth\n1,2\n"), 0.5), Error);

  const session::CutPlanner planner(machine(), {});
  DiscoveryParameters p;
  p.watch_speeds[0] = units::radPerSecFromRpm(4000.0);
  p.watch_depths[0] = 1.4e-3;
  p.watch_depths[3] = 1.4e-3;
  const auto cuts = p.initialCuts(planner, "", 0, limits);
  EXPECT_NEAR(cuts[p.watch_air.size()].condition.engagement.axial_depth, 1e-3, 1e-12);
  EXPECT_NEAR(cuts[p.watch_air.size() + 3].condition.engagement.axial_depth, 1.4e-3, 1e-12);
  Explained::SuggestedTest test;
  test.cut = true;
  test.speed = units::radPerSecFromRpm(4000.0);
  test.engagement = {0.0, units::PI, 3e-3, 1e-4};
  EXPECT_NEAR(planSuggestedTest(planner, test, p.slotRequest("suggested", 2), 1.0, limits)
                  .condition.engagement.axial_depth,
              1e-3, 1e-12);
}

TEST(InstalledModel, keepsThePreviousModel) {
  const TemporaryFolder folder;
  const std::string nominal = written(folder, "nominal.yaml", "old"),
                    better = written(folder, "better.yaml", "new"),
                    best = written(folder, "best.yaml", "newest");
  InstalledModel installed(folder.file("models"), nominal);
  installed.install(better);
  EXPECT_EQ(installed.inUse(), folder.file("models/installed.yaml"));
  EXPECT_EQ(contentOf(installed.inUse()), "new");
  EXPECT_EQ(contentOf(folder.file("models/replaced_1.yaml")), "old");
  EXPECT_EQ(contentOf(nominal), "old");  // the user's file is unchanged
  installed.install(best);
  EXPECT_EQ(contentOf(installed.inUse()), "newest");
  EXPECT_EQ(contentOf(installed.replaced()), "new");
  installed.undo();
  EXPECT_EQ(contentOf(installed.inUse()), "new");
  EXPECT_FALSE(fs::exists(folder.file("models/replaced_2.yaml")));
}

TEST(InstalledModel, changesNothingWhereItCannotWrite) {
  const TemporaryFolder folder;
  const std::string nominal = written(folder, "nominal.yaml", "old"),
                    better = written(folder, "better.yaml", "new");
  InstalledModel installed(folder.file("models"), nominal);
  fs::create_directories(folder.file("models/installed.yaml/in_the_way"));
  try {
    installed.install(better);
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("models/installed.yaml: cannot be written"), std::string::npos);
  }
  EXPECT_EQ(installed.inUse(), nominal);
  EXPECT_FALSE(fs::exists(folder.file("models/replaced_1.yaml")));
  InstalledModel nowhere("/proc/none", nominal);
  EXPECT_THROW(nowhere.install(better), Error);
}

TEST(Report, comparesIdentifiedWithHiddenEffects) {
  const TemporaryFolder folder;
  Explained e = readExplained(written(folder, "report.json", REPORT));
  const EffectEntry runout = effectEntry("runout", {{"offset_um", 9.0}, {"angle_deg", 1.0}}),
                    gain = effectEntry("gain_error", {{"gain", 1.1}}, {{"channel", "fx"}}),
                    helix = effectEntry("helix", {{"helix_deg", 30.0}});
  DiscoveryReport r = reportOf(e, {"made: a cut"}, {runout, gain});
  EXPECT_TRUE(r.named);
  EXPECT_TRUE(r.improved);
  EXPECT_NE(r.text.find("| runout offset_um | 9.02 +- 0.02 | 9 | +1.0 standard deviations |"),
            std::string::npos)
      << r.text;
  EXPECT_NE(r.text.find("| runout angle_deg | 359 +- 1 | 1 | -2.0 standard deviations |"), std::string::npos);
  EXPECT_NE(r.text.find("| gain_error channel | fx | fx |"), std::string::npos);
  EXPECT_NE(r.text.find("gap 21.000 -> 1.010"), std::string::npos);
  EXPECT_NE(r.text.find("suggested test made: a cut"), std::string::npos);
  r = reportOf(e, {}, {runout, helix});
  EXPECT_FALSE(r.named);
  EXPECT_NE(r.text.find("| helix helix_deg | - | 30 | not named |"), std::string::npos) << r.text;
  EXPECT_NE(r.text.find("not hidden"), std::string::npos);
}

TEST(Child, returnsTheExitCode) {
  const TemporaryFolder folder;
  const auto never = [] { return false; };
  EXPECT_EQ(session::runChild({"sh", "-c", "echo output; exit 3"}, folder.file("log"), never), 3);
  EXPECT_EQ(contentOf(folder.file("log")), "output\n");
  EXPECT_EQ(session::runChild({"sleep", "100"}, folder.file("log"), [] { return true; }), 128 + 2);
  EXPECT_THROW(session::runChild({"no_such_program"}, folder.file("log"), never), Error);
  EXPECT_THROW(session::runChild({"true"}, folder.file("none/log"), never), Error);
}

TEST(Parameters, theShippedFileMatchesTheDeclaration) {
  expectShipped<DiscoveryParameters>("config/discover.yaml", "smartmill_launch discover_node");
}

TEST(Parameters, theShippedCutsFitTheShippedMachine) {
  const DiscoveryParameters p;
  const session::CutPlanner planner(readMachineModel("models/stub_mill.yaml"), p.paths);
  const auto cuts = p.initialCuts(planner, "", 0);
  EXPECT_EQ(cuts.size(), p.watch_air.size() + p.watch_speeds.size());
  EXPECT_GE(planner.lanes(), 2 * p.watch_speeds.size());  // a second discovery fits on the same stock
  EXPECT_THROW(p.initialCuts(planner, "", 9), Error);
}

}  // namespace
}  // namespace smartmill::discovery
