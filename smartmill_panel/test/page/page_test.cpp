// The page in a real browser (page_test.py, run once for all cases); screenshots are stored in SCREENSHOTS.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/io/report_page.h"

namespace {

std::string contentOf(const std::string& file) {
  std::ifstream in(file);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Writes report.html, which page_test.py opens.
void makeReport(const std::string& folder) {
  // A chessboard of 48 x 24 pixels.
  static const char PICTURE[] =
      "\x89\x50\x4e\x47\x0d\x0a\x1a\x0a\x00\x00\x00\x0d\x49\x48\x44\x52\x00\x00\x00\x30\x00\x00\x00\x18"
      "\x08\x02\x00\x00\x00\x33\x9f\xe9\x8b\x00\x00\x00\x3b\x49\x44\x41\x54\x78\xda\x63\xf8\x8f\x04\x6c"
      "\x2a\x4e\xc0\xd1\x40\x89\x33\x8c\x3a\x68\xc8\x39\x68\x30\x38\x02\x59\x7c\xd4\x41\x43\xcf\x41\xa3"
      "\xb9\x6c\xd4\x41\xa3\xe5\xd0\xa8\x83\x46\xcb\xa1\xd1\x6c\x3f\x5a\x0e\x8d\x66\xfb\x11\xee\x20\x00"
      "\x47\xbf\x10\xd7\x74\x87\xa6\xe9\x00\x00\x00\x00\x49\x45\x4e\x44\xae\x42\x60\x82";
  std::ofstream(folder + "/chart.png", std::ios::binary).write(PICTURE, sizeof PICTURE - 1);
  smartmill::ReportPage page("nameless");
  page.markdown(
      "# A report & more\n\n## Cuts\n\n| cut | force | verdict |\n|---|---:|---|\n| b | 10.5 +- 2 | met |\n"
      "| c | none | MISSED |\n| a | 9 | met |\n| d | 1e3 | met |\n\n![The chart](chart.png)\n",
      folder);
  page.write(folder + "/report.html");
}

// Reports use the colours of the page.
TEST(Style, ReportsHaveTheColoursOfThePage) {
  const std::string style = contentOf(PAGE "/style.css"), report = smartmill::ReportPage("t").text();
  int colours = 0;
  for (std::size_t at = report.find("--"); at != std::string::npos; at = report.find("--", at + 2)) {
    const std::string colour = report.substr(at, report.find(';', at) - at);
    if (colour.find(": #") == std::string::npos) continue;
    ++colours;
    EXPECT_NE(style.find(colour + ";"), std::string::npos) << colour;
  }
  EXPECT_EQ(colours, 20);
}

class PageTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    browser_ = std::system("command -v chromium >/dev/null && command -v chromedriver >/dev/null") == 0;
    if (!browser_) return;
    const std::string out = SCREENSHOTS;
    std::filesystem::remove_all(out);
    std::filesystem::create_directories(out);
    makeReport(out);
    const int code = std::system(
        ("timeout 300 /usr/bin/python3 " SCRIPT " " NODE " " PAGE " " + out + " >" + out + "/script.txt 2>&1")
            .c_str());
    results_ = nlohmann::json::parse(contentOf(out + "/results.json"), nullptr, false);
    if (code != 0 || !results_.is_object())
      failure_ = contentOf(out + "/script.txt") + contentOf(out + "/log.txt");
  }
  static void check(const std::string& name) {
    if (!browser_) GTEST_SKIP() << "chromium and chromium-driver are not installed";
    ASSERT_TRUE(failure_.empty()) << failure_;
    ASSERT_TRUE(results_.contains(name)) << results_.dump();
    EXPECT_EQ(results_[name].get<std::string>(), "");
  }

  static bool browser_;
  static nlohmann::json results_;
  static std::string failure_;
};

bool PageTest::browser_ = false;
nlohmann::json PageTest::results_;
std::string PageTest::failure_;

TEST_F(PageTest, ValuesAreTheTopics) {
  check("ValuesAreTheTopics");
}
TEST_F(PageTest, MessagesAreDecodedAsByRos) {
  check("MessagesAreDecodedAsByRos");
}
TEST_F(PageTest, ForceAndSpectrumAreThoseOfTheMachine) {
  check("ForceAndSpectrumAreThoseOfTheMachine");
}
TEST_F(PageTest, EveryViewIsDrawn) {
  check("EveryViewIsDrawn");
}
TEST_F(PageTest, TheFleetIsShown) {
  check("TheFleetIsShown");
}
TEST_F(PageTest, InstrumentsAreShown) {
  check("InstrumentsAreShown");
}
TEST_F(PageTest, ThePartIsShown) {
  check("ThePartIsShown");
}
TEST_F(PageTest, HealthOfTheNodesIsShown) {
  check("HealthOfTheNodesIsShown");
}
TEST_F(PageTest, ANewInstrumentIsTriedWrittenAndCalibrated) {
  check("ANewInstrumentIsTriedWrittenAndCalibrated");
}
TEST_F(PageTest, SilenceTurnsValuesGrey) {
  check("SilenceTurnsValuesGrey");
}
TEST_F(PageTest, HostileOriginsAndCommandsWithoutTokenAreRefused) {
  check("HostileOriginsAndCommandsWithoutTokenAreRefused");
}
TEST_F(PageTest, ThePageCommandsAfterAnUnlock) {
  check("ThePageCommandsAfterAnUnlock");
}
TEST_F(PageTest, ANoteIsKeptInTheLogForEveryPage) {
  check("ANoteIsKeptInTheLogForEveryPage");
}
TEST_F(PageTest, AcceptedAndRejectedHitsAreShown) {
  check("AcceptedAndRejectedHitsAreShown");
}
TEST_F(PageTest, EveryPlotIsSavedAsPictureAndNumbers) {
  check("EveryPlotIsSavedAsPictureAndNumbers");
}
TEST_F(PageTest, TheLayoutIsKept) {
  check("TheLayoutIsKept");
}
TEST_F(PageTest, MachinesOfOtherNamespacesHaveTheirStatusLines) {
  check("MachinesOfOtherNamespacesHaveTheirStatusLines");
}
TEST_F(PageTest, ReportsSortAndZoomWithoutAServer) {
  check("ReportsSortAndZoomWithoutAServer");
}
TEST_F(PageTest, ThePhoneShowsVerdictAndNextSpeed) {
  check("ThePhoneShowsVerdictAndNextSpeed");
}
TEST_F(PageTest, ThePhoneSetsSpeedAndTeeth) {
  check("ThePhoneSetsSpeedAndTeeth");
}
TEST_F(PageTest, ThePhoneStatesThatThereIsNoSound) {
  check("ThePhoneStatesThatThereIsNoSound");
}
TEST_F(PageTest, RawSoundIsNotServed) {
  check("RawSoundIsNotServed");
}
TEST_F(PageTest, NoErrorOnTheConsole) {
  check("NoErrorOnTheConsole");
}
TEST_F(PageTest, ALostNodeIsReportedAndARestartedOneIsShown) {
  check("ALostNodeIsReportedAndARestartedOneIsShown");
}

}  // namespace
