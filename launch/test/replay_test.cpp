// A short session is recorded from the simulated machine; its replay must give the same results to the last
// digit. A browser looks at both.

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

/// A page in the browser that looks on (watch.py) while a command runs.
class Onlooker {
 public:
  /// @param topics that the page must have got
  Onlooker(const std::string& port, const std::string& name, const std::string& topics)
      : log_(std::string(SCREENSHOTS) + "/" + name + ".txt") {
    std::filesystem::create_directories(SCREENSHOTS);
    thread_ = std::thread([this, command = "timeout 400 /usr/bin/python3 " WATCH " " + port +
                                           " " SCREENSHOTS "/" + name + ".png " + topics + " >'" + log_ +
                                           "' 2>&1"] { code_ = std::system(command.c_str()); });
  }
  /// What went wrong; empty: nothing.
  std::string verdict() {
    thread_.join();
    return code_ == 0 ? "" : contentOf(log_);
  }

 private:
  std::string log_;
  int code_ = 0;
  std::thread thread_;
};

bool browserThere() {
  return std::system("command -v chromium >/dev/null && command -v chromedriver >/dev/null") == 0;
}
std::string page_live, page_replayed;  // what the page lacked

TEST(Replay, OfAShortSessionIsTheSameToTheLastDigit) {
  const TemporaryFolder folder;
  setenv("ROS_HOSTNAME", "localhost", 1);
  setenv("ROS_HOME", folder.file("ros_home").c_str(), 1);
  const std::string live = folder.file("live.mcap"), again = folder.file("again.bag");  // both formats
  const std::string summary = folder.file("session.json"), log = folder.file("log.txt");

  const bool look = browserThere();
  const std::string page = freePort(), shown = look ? " panel:=true panel_port:=" + page : "";
  std::optional<Onlooker> onlooker;
  if (look)
    onlooker.emplace(page, "live",
                     "tool/frf panel/revolution panel/spectrum panel/strip session/state cnc/load");
  // A roslaunch that the launch test framework has not started needs a master of its own.
  run("roslaunch -p " + freePort() + " " SHORT_SESSION " port:=" + freePort() + " bag:=" + live +
          " summary:=" + summary + " motor_currents:=true" + shown,
      log);
  if (onlooker) page_live = onlooker->verdict();
  onlooker.reset();
  ASSERT_NE(contentOf(summary).find("\"completed\": true"), std::string::npos) << contentOf(log);
  // No calibration was given: the session's moves in air and its slots along X made it, and it says so.
  const std::string told = contentOf(summary);
  const std::size_t motors = told.find("motors: X ");
  ASSERT_NE(motors, std::string::npos) << told;
  double constant = 0.0, deviation = 0.0;
  ASSERT_EQ(std::sscanf(told.c_str() + motors, "motors: X %lf +- %lf N/A", &constant, &deviation), 2) << told;
  EXPECT_NEAR(constant, 200.0, 3.0 * deviation);
  EXPECT_LT(deviation, 0.15 * constant);
  EXPECT_NE(told.find("bandwidth", motors), std::string::npos) << told;
  if (look)
    onlooker.emplace(page, "replayed", "tool/frf panel/revolution panel/spectrum panel/strip cnc/load");
  run("roslaunch -p " + freePort() + " smartmill_launch replay.launch rate:=0 motor_currents:=true bag:=" +
          live + " out:=" + again + shown,
      log);
  if (onlooker) page_replayed = onlooker->verdict();
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

TEST(Replay, IsShownByThePageLikeTheSession) {
  if (!browserThere()) GTEST_SKIP() << "chromium and chromium-driver are not installed";
  EXPECT_EQ(page_live, "");
  EXPECT_EQ(page_replayed, "");
}

}  // namespace
