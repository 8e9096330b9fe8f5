// Records a short session of the simulated machine; its replay must give the same results to the last digit.
// The page of the panel is checked in a browser during both.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "launched.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace {

using smartmill::TemporaryFolder;
using namespace smartmill::testing;

/// Checks the page of the panel in a browser (watch.py) while a command runs.
class PageCheck {
 public:
  /// @param topics that the page must receive
  PageCheck(const std::string& port, const std::string& name, const std::string& topics)
      : log_(std::string(SCREENSHOTS) + "/" + name + ".txt") {
    std::filesystem::create_directories(SCREENSHOTS);
    thread_ = std::thread([this, command = "timeout 400 /usr/bin/python3 " WATCH " " + port +
                                           " " SCREENSHOTS "/" + name + ".png " + topics + " >'" + log_ +
                                           "' 2>&1"] { code_ = std::system(command.c_str()); });
  }
  /// Waits for the end of the check. @return what failed; empty: nothing
  std::string fault() {
    thread_.join();
    return code_ == 0 ? "" : contentOf(log_);
  }

 private:
  std::string log_;
  int code_ = 0;
  std::thread thread_;
};

bool browserIsInstalled() {
  return std::system("command -v chromium >/dev/null && command -v chromedriver >/dev/null") == 0;
}
std::string page_live, page_replayed;  // faults of the page

TEST(Replay, OfAShortSessionIsTheSameToTheLastDigit) {
  const TemporaryFolder folder;
  setenv("ROS_HOSTNAME", "localhost", 1);
  setenv("ROS_HOME", folder.file("ros_home").c_str(), 1);
  const std::string live = folder.file("live.mcap"), again = folder.file("again.bag");  // both formats
  const std::string summary = folder.file("session.json"), log = folder.file("log.txt");

  const bool with_page = browserIsInstalled();
  const std::string page = freePort(), panel = with_page ? " panel:=true panel_port:=" + page : "";
  std::optional<PageCheck> page_check;
  if (with_page)
    page_check.emplace(page, "live",
                       "tool/frf panel/revolution panel/spectrum panel/strip session/state cnc/load");
  // A roslaunch outside the launch test framework needs its own master.
  run("roslaunch -p " + freePort() + " " SHORT_SESSION " port:=" + freePort() + " bag:=" + live +
          " summary:=" + summary + " motor_currents:=true" + panel,
      log);
  if (page_check) page_live = page_check->fault();
  page_check.reset();
  ASSERT_NE(contentOf(summary).find("\"completed\": true"), std::string::npos) << contentOf(log);
  // Without a given calibration the session calibrates the motors by its moves in air and its slots along X.
  const std::string summary_text = contentOf(summary);
  const std::size_t motors = summary_text.find("motors: X ");
  ASSERT_NE(motors, std::string::npos) << summary_text;
  double constant = 0.0, deviation = 0.0;
  ASSERT_EQ(std::sscanf(summary_text.c_str() + motors, "motors: X %lf +- %lf N/A", &constant, &deviation), 2)
      << summary_text;
  EXPECT_NEAR(constant, 200.0, 3.0 * deviation);
  EXPECT_LT(deviation, 0.15 * constant);
  EXPECT_NE(summary_text.find("bandwidth", motors), std::string::npos) << summary_text;
  if (with_page)
    page_check.emplace(page, "replayed", "tool/frf panel/revolution panel/spectrum panel/strip cnc/load");
  run("roslaunch -p " + freePort() + " smartmill_launch replay.launch rate:=0 bag:=" + live +
          " out:=" + again + panel,
      log);
  if (page_check) page_replayed = page_check->fault();
  const std::string replayed = contentOf(log);
  const int code = run("rosrun smartmill_launch compare_bags " + live + " " + again, log);
  const std::string verdict = contentOf(log);
  EXPECT_EQ(code, 0) << verdict << replayed;
  for (const char* topic : {"tool/frf", "tool/modes", "material/coefficients", "material/force_curve",
                            "force/measured", "force/compensated"}) {
    const std::size_t line = verdict.find(topic);
    ASSERT_NE(line, std::string::npos) << verdict;
    EXPECT_EQ(verdict.substr(line, 80).find(" 0 common"), std::string::npos) << verdict;
  }
}

TEST(Replay, ThePageShowsSessionAndReplay) {
  if (!browserIsInstalled()) GTEST_SKIP() << "chromium and chromium-driver are not installed";
  EXPECT_EQ(page_live, "");
  EXPECT_EQ(page_replayed, "");
}

}  // namespace
