#include "smartmill_launch/report/session_report.h"

#include <cmath>
#include <string>
#include <string_view>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"

namespace smartmill::report {
namespace {

using session::CutVerdict;
using units::TWO_PI;

constexpr double RATE = 25600.0;          // [Hz]
constexpr double SPEED = 100.0 * TWO_PI;  // [rad/s] 256 samples per revolution

MeasuredModes modesOf(const std::string& direction, double frequency, double stiffness, double std_share) {
  MeasuredModes out;
  out.tool = "end_mill";
  out.point = POINT_TOOL_TIP;
  out.direction = direction;
  out.unit = "m/N";
  Mode mode;
  mode.frequency = frequency;
  mode.damping_ratio = 0.03;
  mode.gain = 1.0 / stiffness;
  mode.frequency_std = frequency * std_share;
  mode.gain_std = mode.gain * std_share;
  out.model.modes = {mode};
  return out;
}

CoefficientSet coefficients(double ktc, double std_dev) {
  CoefficientSet out;
  out.value = out.std_dev = NOT_IDENTIFIED;
  out.value.ktc = ktc;
  out.std_dev.ktc = std_dev;
  out.value.kte = 10e3;
  return out;
}

/// One second of a sine of each axis over two blocks of half a second, the first still settling.
ForceTrack sine(double amplitude, double line) {
  ForceTrack track;
  constexpr std::size_t HALF = 12800;
  for (std::size_t half = 0; half < 2; ++half) {
    ForceBlock block;
    block.sample_rate = RATE;
    block.first_index = half * HALF;
    block.stamp = 10.0 + 0.5 * static_cast<double>(half);
    block.status = half == 0 ? ForceBlock::Status::settling : ForceBlock::Status::compensated;
    for (std::size_t i = 0; i < HALF; ++i) {
      const double revolutions = static_cast<double>(block.first_index + i) / 256.0;
      for (std::size_t a = 0; a < 3; ++a)
        block.force[a].push_back(amplitude * std::sin(TWO_PI * line * revolutions) /
                                 static_cast<double>(a + 1));
    }
    track.add(block);
  }
  return track;
}

RecordedCut cut(const std::string& name, double depth) {
  RecordedCut out;
  out.condition.kind = CuttingCondition::Kind::cut;
  out.condition.name = name;
  out.condition.spindle_speed = SPEED;
  out.condition.engagement.axial_depth = depth;
  out.condition.stamp = 9.0;
  out.steady_from = 10.0;
  out.steady_to = 10.95;
  return out;
}

SessionRecording example() {
  SessionRecording recording;
  recording.modes = {modesOf("x", 1002.0, 20.4e6, 0.001)};
  recording.true_modes = {modesOf("x", 1000.0, 20.0e6, 0.0)};
  recording.coefficients = coefficients(990e6, 5e6);
  recording.true_coefficients = coefficients(1000e6, 0.0);
  StabilityChart& chart = recording.chart.emplace();
  chart.limit = {{0.5 * SPEED, SPEED, 2.0 * SPEED}, {1e-3, 2e-3, 1e-3}, {}};
  chart.exit = units::PI;
  chart.absolute_depth_limit = 1e-3;
  RecordedCut resonance = cut("resonance", 0.5e-3);
  resonance.raw = sine(200.0, 4.0);
  resonance.compensated = sine(103.0, 4.0);
  resonance.truth = sine(100.0, 4.0);
  RecordedCut stable = cut("verify_stable", 1.5e-3), unstable = cut("verify_unstable", 3e-3);
  stable.windows = {{false, NOT_A_NUMBER, 1.0}, {false, NOT_A_NUMBER, 1.0}, {false, NOT_A_NUMBER, 1.0}};
  unstable.windows = {{true, 812.0, 90.0}, {true, 813.0, 99.0}, {true, 814.0, 100.0}};
  stable.truth = sine(100.0, 4.0);
  unstable.truth = sine(100.0, 4.37);
  recording.cuts = {stable, unstable, resonance};
  return recording;
}

const Figure& figure(const Report& report, std::string_view name) {
  for (const Section& section : report.sections) {
    for (const Figure& f : section.figures) {
      if (f.name == name) return f;
    }
  }
  throw Error("no figure " + std::string(name));
}

TEST(SessionReport, ComparesFiguresWithTheTruth) {
  const Report report = makeReport(example(), {{}, {1.9e-3, 1.9e-3, NOT_A_NUMBER}, {}});
  const Figure& ktc = figure(report, "Ktc");
  EXPECT_NEAR(ktc.percent(), -1.0, 1e-9);
  EXPECT_NEAR(ktc.sigmas(), -2.0, 1e-9);
  EXPECT_TRUE(*ktc.met());
  EXPECT_NEAR(figure(report, "x mode 1 frequency").percent(), 0.2, 1e-9);
  EXPECT_NEAR(figure(report, "x mode 1 stiffness").percent(), 2.0, 1e-9);
  EXPECT_NEAR(figure(report, "x mode 1 stiffness").std_dev, 0.0204, 1e-9);  // 0.1 % of 20.4 N/um
  EXPECT_NEAR(figure(report, "x compensated").percent(), 3.0, 1e-9);
  EXPECT_NEAR(figure(report, "z raw").percent(), 100.0, 1e-9);
  EXPECT_NEAR(figure(report, "limit at 6000 rpm").estimate, 2.0, 1e-9);
  EXPECT_NEAR(figure(report, "limit at 6000 rpm").truth, 1.9, 1e-9);
  EXPECT_EQ(report.met(), report.targets());
  EXPECT_EQ(report.targets(), 11u);  // Ktc, frequency, stiffness, three ranges raw and compensated, two cuts
}

TEST(SessionReport, ComparesCutsWithTheChart) {
  SessionRecording recording = example();
  Report report = makeReport(recording, {});
  ASSERT_EQ(report.cuts.size(), 2u);
  EXPECT_EQ(report.cuts[0].predicted, CutVerdict::Kind::stable);
  EXPECT_EQ(report.cuts[1].predicted, CutVerdict::Kind::chatter);
  EXPECT_TRUE(report.cuts[0].met() && report.cuts[1].met());
  EXPECT_LT(report.cuts[0].nonperiodic, 1e-3);
  EXPECT_GT(report.cuts[1].nonperiodic, 0.9);  // a line far from every harmonic
  recording.cuts[0].windows = recording.cuts[1].windows;
  report = makeReport(recording, {});
  EXPECT_FALSE(report.cuts[0].met());
  EXPECT_EQ(report.met() + 1, report.targets());
}

TEST(SessionReport, EvaluatesSettledSamplesOnly) {
  const SessionRecording recording = example();
  const auto [from, to] = evaluatedSamples(*recording.cut("resonance"), 10.0);
  EXPECT_EQ(from, 12800u);  // the first block is settling
  EXPECT_EQ(to, 24320u);    // 0.95 s
  RecordedCut never = *recording.cut("resonance");
  never.steady_from = never.steady_to = NOT_A_NUMBER;
  EXPECT_EQ(evaluatedSamples(never, 10.0).first, evaluatedSamples(never, 10.0).second);
}

TEST(SessionReport, AModeThatWasNotFoundMissesItsTargets) {
  SessionRecording recording = example();
  recording.true_modes[0].model.modes.push_back(modesOf("x", 3000.0, 40e6, 0.0).model.modes[0]);
  const Report report = makeReport(recording, {});
  EXPECT_FALSE(*figure(report, "x mode not found frequency").met());
}

TEST(SessionReport, ReportsMeasuredValuesWithoutTruth) {
  SessionRecording recording = example();
  recording.true_modes.clear();
  recording.true_coefficients.reset();
  for (RecordedCut& c : recording.cuts) c.truth = ForceTrack();
  const Report report = makeReport(recording, {});
  EXPECT_EQ(report.targets(), 2u);  // the cuts, checked against the measured chart
  EXPECT_TRUE(std::isnan(figure(report, "Ktc").truth));
  EXPECT_NE(markdown(report).find("Ktc"), std::string::npos);
  EXPECT_NE(markdown(report).find("2 of 2 targets met"), std::string::npos);
}

TEST(SessionReport, ATrueLimitThatWasNotComputedLeavesItsTargetsUnchecked) {
  SessionRecording recording = example();
  // A pocket at 6000 rpm, four times as deep as the valleys.
  recording.chart->limit = {};
  for (int i = 0; i <= 20; ++i) {
    recording.chart->limit.spindle_speed.push_back(units::radPerSecFromRpm(5000.0 + 100.0 * i));
    recording.chart->limit.depth.push_back(std::abs(i - 10) < 3 ? 4e-3 : 1e-3);
    recording.chart->limit.chatter_frequency.push_back(1000.0);
  }
  const std::size_t without_pocket = makeReport(recording, {}).targets();
  const Report report = makeReport(recording, {{}, {}, "smartmill lobes: program not found"});
  EXPECT_TRUE(figure(report, "pocket 1").unchecked);
  EXPECT_EQ(report.targets(), without_pocket + 1);
  EXPECT_LT(report.met(), report.targets());
  EXPECT_NE(markdown(report).find("NOT CHECKED: smartmill lobes: program not found"), std::string::npos);
  EXPECT_NE(markdown(report).find("| NOT CHECKED |"), std::string::npos);
  const auto parsed = nlohmann::json::parse(json(report, ""));
  for (const auto& f : parsed["figures"]) {
    if (f["quantity"] == "pocket 1") {
      EXPECT_TRUE(f["met"].is_null());
    }
  }
}

TEST(SessionReport, ResultsThatAFailedSessionLacksAreNotChecked) {
  const std::string done = R"({"steps": [{"name": "connect", "done": true}]})";
  const std::string failed =
      R"({"steps": [{"name": "connect", "done": true}, {"name": "chart", "done": false, "detail": "no modes"}]})";
  SessionRecording recording = example();
  recording.chart.reset();
  EXPECT_TRUE(notMeasured(recording, "").empty());
  EXPECT_TRUE(notMeasured(recording, done).empty());
  EXPECT_THROW(notMeasured(recording, "{broken"), Error);
  Report report = makeReport(recording, {});
  const std::size_t targets = report.targets(), met = report.met();
  report.unchecked = notMeasured(recording, failed);
  EXPECT_EQ(report.targets(), targets + report.unchecked.size());
  EXPECT_EQ(report.met(), met);
  const std::string text = markdown(report);
  EXPECT_NE(text.find("- NOT CHECKED: step 'chart' failed: no modes\n"), std::string::npos);
  EXPECT_NE(text.find("- NOT CHECKED: stability chart: not in the recording\n"), std::string::npos);
  EXPECT_EQ(text.find("cutting coefficients: not in the recording"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(json(report, failed))["unchecked"].size(), report.unchecked.size());
}

TEST(SessionReport, WritesAJsonSummary) {
  const Report report = makeReport(example(), {});
  const auto parsed = nlohmann::json::parse(json(report, R"({"tool": "end_mill"})"));
  EXPECT_EQ(parsed["session"]["tool"], "end_mill");
  EXPECT_EQ(parsed["targets"], parsed["targets_met"]);
  bool found = false;
  for (const auto& f : parsed["figures"]) {
    if (f["quantity"] != "Ktc") continue;
    found = true;
    EXPECT_NEAR(f["difference_percent"].get<double>(), -1.0, 1e-9);
    EXPECT_EQ(f["met"], true);
  }
  EXPECT_TRUE(found);
  EXPECT_TRUE(parsed["cuts"][0]["true_depth_limit_m"].is_null());
  EXPECT_THROW(json(report, "{broken"), Error);
}

// Combined values contain the stored ones: Var(now - before) = Var(before) - Var(now); 5 - 3 is a std of 4.
TEST(SessionReport, statesHowMuchShorterTheTestPlanBecame) {
  EXPECT_TRUE(testPlanNotes("").empty());
  EXPECT_TRUE(testPlanNotes(R"({"completed": true})").empty()) << "a summary without a test plan";
  const std::string summary =
      R"({"coefficients": [{"ktc_n_per_m2": 802e6, "ktc_n_per_m2_std": 3e6, "kte_n_per_m": 2e4,
    "kte_n_per_m_std": 300.0}], "test_plan": {"planned_tests": 8, "made_tests": 4, "planned_cuts": 4, "made_cuts": 2,
    "planned_time_s": 30.0, "made_time_s": 12.0, "stored": "4 tests in 1 identification", "stored_used": true,
    "stored_coefficients": [{"ktc_n_per_m2": 800e6, "ktc_n_per_m2_std": 5e6, "kte_n_per_m": null, "kte_n_per_m_std": 500.0}]}})";
  const auto notes = testPlanNotes(summary);
  ASSERT_EQ(notes.size(), 3u);
  EXPECT_EQ(notes[0],
            "test plan: 2 of 4 cuts and 2 of 4 air cuts, 0.20 of 0.50 min (4 tests and 0.30 min fewer); "
            "database: 4 "
            "tests in 1 identification");
  EXPECT_EQ(notes[1],
            "Ktc: stored 800.00 +- 5.00 N/mm2, now 802.00 +- 3.00 N/mm2, difference 0.5 standard deviations");
}

TEST(SessionReport, namesTheCutsThatWereChosenForTheirInformation) {
  const auto notes = testPlanNotes(
      R"({"test_plan": {"planned_tests": 8, "made_tests": 7, "planned_cuts": 4, "made_cuts": 3, "chosen_cuts":
    [{"name": "half_up_4", "information_per_s": 1.256}, {"name": "slot_1", "information_per_s": 0.5}]}})");
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_EQ(notes[1], "cuts by their information per second of cutting: half_up_4 (1.26), slot_1 (0.50)");
}

}  // namespace
}  // namespace smartmill::report
