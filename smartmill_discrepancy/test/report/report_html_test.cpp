#include "smartmill_discrepancy/report/report_html.h"

#include <string>

#include <gtest/gtest.h>

#include "smartmill_core/io/text_file.h"
#include "smartmill_core/testing/mill.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_discrepancy/report/shop_text.h"

namespace smartmill::discrepancy {
namespace {

constexpr double STD_DEV = 0.01;  // of a gap at the noise: 5000 samples

// A slot and an air cut, the tool off centre or with unequal teeth.
Explanation runoutOrTeeth() {
  Explanation e;
  e.verdict = Verdict::explained;
  e.nominal = e.model = mill(4);
  ReportedTest slot;
  slot.test.name = "slot";
  slot.test.spindle_speed = units::radPerSecFromRpm(6000.0);
  slot.test.engagement = Engagement{0.0, units::PI, 2e-3, 50e-6};
  slot.heldout = true;
  ReportedTest air;
  air.test.name = "air<1>";
  air.test.kind = TestKind::air;
  air.test.spindle_speed = units::radPerSecFromRpm(3000.0);
  e.tests = {slot, air};
  e.noise = {{"fx", 2.0}, {"load_meter", 1e-3}};
  e.gaps = {{"slot", "fx", true, 30.0, 1.0, STD_DEV},
            {"slot", "load_meter", true, 40.0, 1.0, STD_DEV},
            {"air<1>", "fx", false, 1.0, 1.0, STD_DEV},
            {"air<1>", "load_meter", false, 1.0, 1.5, STD_DEV}};
  e.before = {25.0, 35.0};
  e.after = {1.0, 1.0};
  e.testable = 30;
  FoundEffect runout;
  runout.name = "runout";
  runout.parameters = {{"offset_um", 20.0, 0.5, 0.0}, {"angle_deg", 90.0, 1.0, 0.0}};
  runout.confidence = 0.3;
  runout.presence = 1.0;
  runout.heldout_without = 35.0;
  runout.alternatives = {
      {"tooth_radius", 1e5, {{"offset_um[0]", -9.0, 0.0, 0.0}, {"offset_um[1]", 9.0, 0.0, 0.0}}, 1.0}};
  e.effects = {runout};
  e.not_separable = {{"runout", "tooth_radius"}};
  e.channels = {{"fx", -0.8, 0.9999, {}, {}, 0.0, 0.0}};
  e.suggested_test = "a cut";
  e.suggested_cut = slot.test;
  e.outcome = TestOutcome{"runout", "tooth_radius", "fx", 850.0, 1020.0, 0.15, false};
  return e;
}

std::string pageOf(const Explanation& e) {
  const TemporaryFolder folder;
  writeHtml(e, "/data/mill<2>/", folder.file("."));
  return readText(folder.file("report.html"));
}

void expectContains(const std::string& page, const std::string& part) {
  EXPECT_NE(page.find(part), std::string::npos) << part << " is missing in\n"
                                                << page.substr(page.find("<main>"));
}

TEST(ReportHtml, NamesCauseAndRivalWithTheirSizes) {
  const std::string page = pageOf(runoutOrTeeth());
  expectContains(page, "Measurement and simulation: mill&lt;2&gt;");
  expectContains(page, "Cause: <b>tool axis off centre or teeth of unequal radius</b>. ");
  expectContains(page, "a dial indicator on the turning shank reads <b>0.0400 &plusmn; 0.0020 mm</b>");
  expectContains(
      page,
      "largest difference of the radius between two teeth <b>18.0 &micro;m</b>: <b>these tests fit both</b>");
  expectContains(page, "one of them is present: probability <b>> 99.9 %</b>");
  expectContains(page, "difference 35.0 times the noise without it, 1.00 with it");
}

TEST(ReportHtml, StatesTheNextTestAndWhatItsOutcomeMeans) {
  const std::string page = pageOf(runoutOrTeeth());
  expectContains(page, "slot, 6000 rpm, feed 0.05 mm per tooth, depth 2 mm, immersion 0&deg; to 180&deg;");
  expectContains(page,
                 "near <b>850 N</b>: tool axis off centre; near <b>1020 N</b>: teeth of unequal radius");
  expectContains(page, "no chatter");
  Explanation separated = runoutOrTeeth();
  separated.not_separable.clear();
  separated.suggested_cut.reset();
  separated.suggested_test.reset();
  expectContains(pageOf(separated), "No further test is needed");
}

TEST(ReportHtml, MarksWhatGotWorse) {
  const std::string page = pageOf(runoutOrTeeth());
  expectContains(page, "<td>air&lt;1&gt;<td>air cut<td>3000");
  expectContains(page, "<span class=\"bad\">worse</span> spindle load meter 1.00 &rarr; 1.50");
  expectContains(page, "1 of 4 signals");
}

TEST(ReportHtml, StatesWhetherTheSearchWasComplete) {
  Explanation e = runoutOrTeeth();
  expectContains(pageOf(e), "All 30 causes that these tests can show were checked.");
  e.not_tried = {"helix", "feed_error"};
  e.spent_budget = 60.0;
  e.untestable = {{"process_damping", "the model's tool is rigid"}};
  e.notes = {"fp is not simulated"};
  const std::string page = pageOf(e);
  expectContains(page, "28 of 30 causes that these tests can show were checked");
  expectContains(page, "smartmill explain /data/mill&lt;2&gt; -o ");
  expectContains(page, " --budget 0");
  expectContains(page, "<li><b>other helix angle of the tool</b> <span class=\"dim\">(helix)</span></li>");
  expectContains(page,
                 "(process_damping)</span>: these tests cannot show it, the model's tool is rigid</li>");
  expectContains(page, "<h2>Notes</h2>\n<ul><li>fp is not simulated</li></ul>");
}

// The largest first, and none below one percent of what remains.
TEST(ReportHtml, ListsTheLargestRemainderFirst) {
  Explanation e = runoutOrTeeth();
  e.verdict = Verdict::partly_explained;
  e.after.fit = 2.0;  // 10000 fitted samples: 30000 squares above the noise
  const auto finding = [](double order, double squares) {
    Finding f;
    f.channel = "fx";
    f.domain = "order";
    f.location["order"] = order;
    f.amplitude = order;
    f.squares = squares;
    return f;
  };
  e.unexplained = {finding(1.0, 200.0), finding(3.0, 600.0), finding(8.0, 15000.0)};
  const std::string page = pageOf(e);
  expectContains(page,
                 "Its largest part: force x, 8.00 N, 8 times per revolution (2 times the tooth passing).");
  expectContains(page, "<td>50 %");
  expectContains(page, "<td>2 %");
  EXPECT_EQ(page.find("once per revolution"), std::string::npos);
}

TEST(ReportHtml, AgreementNeedsNoCause) {
  Explanation e;
  e.before = e.after = {1.0, 1.0};
  e.testable = 30;
  const std::string page = pageOf(e);
  expectContains(page, "Measurement and simulation agree");
  expectContains(page, "Nothing: use the supplied model.");
  EXPECT_EQ(page.find("corrected model:<pre>"), std::string::npos);
}

TEST(ShopText, HasTheDigitsThatTheIntervalDetermines) {
  EXPECT_EQ(intervalText(21.4224, 0.0633), "21.42 &plusmn; 0.12");
  EXPECT_EQ(intervalText(0.41939, 0.0001), "0.4194 &plusmn; 0.0002");
  EXPECT_EQ(intervalText(339.19, 1e-4), "339.2 &plusmn; less than 0.1");
  EXPECT_EQ(intervalText(1234.0, 40.0), "1234 &plusmn; 78");
  EXPECT_EQ(intervalText(18.0, 0.0), "18.0");
}

TEST(ShopText, GivesChannelsTheirUnits) {
  EXPECT_EQ(channelWords("load_meter").text(0.035), "35.0 mV");
  EXPECT_EQ(channelWords("tool_x").text(2.5e-6), "2.50 &micro;m");
  EXPECT_EQ(channelWords("fz").text(1234.4), "1234 N");
}

// RMS over samples: of 3 and 4 in equal parts.
TEST(ShopText, WeighsDifferencesBySamples) {
  const std::vector<TestGap> cells{{"a", "fx", false, 3.0, 1.0, 0.01}, {"b", "fx", false, 4.0, 1.0, 0.01}};
  const auto all = [](const TestGap&) { return true; };
  EXPECT_NEAR(differenceOf(cells, false, all), std::sqrt(12.5), 1e-12);
  EXPECT_NEAR(differenceOf(cells, true, all), 1.0, 1e-12);
}

}  // namespace
}  // namespace smartmill::discrepancy
