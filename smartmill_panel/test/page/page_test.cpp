// The page in a real browser (page_test.py, once for all cases); its screenshots stay in SCREENSHOTS.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace {

std::string contentOf(const std::string& file) {
  std::ifstream in(file);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

class PageTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    browser_ = std::system("command -v chromium >/dev/null && command -v chromedriver >/dev/null") == 0;
    if (!browser_) return;
    const std::string out = SCREENSHOTS;
    std::filesystem::remove_all(out);
    std::filesystem::create_directories(out);
    const int code = std::system(
        ("timeout 300 /usr/bin/python3 " SCRIPT " " NODE " " PAGE " " + out + " >" + out + "/script.txt 2>&1")
            .c_str());
    results_ = nlohmann::json::parse(contentOf(out + "/results.json"), nullptr, false);
    if (code != 0 || !results_.is_object())
      told_ = contentOf(out + "/script.txt") + contentOf(out + "/log.txt");
  }
  static void check(const std::string& name) {
    if (!browser_) GTEST_SKIP() << "chromium and chromium-driver are not installed";
    ASSERT_TRUE(told_.empty()) << told_;
    ASSERT_TRUE(results_.contains(name)) << results_.dump();
    EXPECT_EQ(results_[name].get<std::string>(), "");
  }

  static bool browser_;
  static nlohmann::json results_;
  static std::string told_;
};

bool PageTest::browser_ = false;
nlohmann::json PageTest::results_;
std::string PageTest::told_;

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
TEST_F(PageTest, SilenceTurnsValuesGrey) {
  check("SilenceTurnsValuesGrey");
}
TEST_F(PageTest, HostileOriginsAndCommandsWithoutTokenAreRefused) {
  check("HostileOriginsAndCommandsWithoutTokenAreRefused");
}
TEST_F(PageTest, ThePageCommandsAfterAnUnlock) {
  check("ThePageCommandsAfterAnUnlock");
}
TEST_F(PageTest, NoErrorOnTheConsole) {
  check("NoErrorOnTheConsole");
}
TEST_F(PageTest, ADeadNodeIsToldAndOneThatIsBackShows) {
  check("ADeadNodeIsToldAndOneThatIsBackShows");
}

}  // namespace
