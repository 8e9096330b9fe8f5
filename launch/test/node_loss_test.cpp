// A node that ends while a session needs it stops the session with one line, and motion is disarmed. The node
// is killed while another one measures, so that no answer of its own is awaited.

#include <signal.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "launched.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace {

using smartmill::TemporaryFolder;
using namespace smartmill::testing;
using ::testing::HasSubstr;
using ::testing::Not;

// @return false: the graph has ended before
bool awaitText(const std::string& log, const std::string& text, const std::atomic<bool>& ended) {
  while (contentOf(log).find(text) == std::string::npos) {
    if (ended) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return true;
}

// Kills the processes whose command line contains both texts. @return their number
int killAll(const std::string& one, const std::string& other) {
  int killed = 0;
  std::error_code failed;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", failed)) {
    const std::string name = entry.path().filename(), command = contentOf(entry.path() / "cmdline");
    if (name.find_first_not_of("0123456789") != std::string::npos || command.find(one) == std::string::npos ||
        command.find(other) == std::string::npos)
      continue;
    killed += ::kill(std::stoi(name), SIGKILL) == 0 ? 1 : 0;
  }
  return killed;
}

TEST(Session, StopsWhenANodeThatItNeedsEnds) {
  const TemporaryFolder folder;
  setenv("ROS_HOSTNAME", "localhost", 1);
  const std::string home = folder.file("ros_home"), summary = folder.file("session.json"),
                    log = folder.file("log.txt");
  setenv("ROS_HOME", home.c_str(), 1);
  std::atomic<bool> ended{false};
  std::thread graph([&] {
    run("roslaunch -p " + freePort() + " " SHORT_SESSION " bag:=" + folder.file("session.bag") +
            " port:=" + freePort() + " summary:=" + summary,
        log);
    ended = true;
  });
  const bool armed = awaitText(log, "ok   arm motion", ended);
  // The path of its log distinguishes it from the nodes of other tests.
  const int killed = killAll("__name:=kalman", home);
  graph.join();
  ASSERT_TRUE(armed) << contentOf(log);
  ASSERT_EQ(killed, 1);
  const std::string text = contentOf(log), result = contentOf(summary);
  EXPECT_THAT(result, HasSubstr("\"completed\": false"));
  EXPECT_THAT(text, HasSubstr("node /smartmill/kalman has ended"));
  EXPECT_THAT(text, HasSubstr("disarm motion"));
  EXPECT_THAT(text, Not(HasSubstr("FAIL disarm")));
  EXPECT_THAT(text, Not(HasSubstr("air cut")));
}

}  // namespace
