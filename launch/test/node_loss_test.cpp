// A node that ends while a session needs it stops the session with one line, and motion is disarmed; the
// session is resumed without what it had measured. The node is killed while another one measures, so that no
// answer of its own is awaited.

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

// Signals the processes whose command line contains both texts. @return their number
int killAll(const std::string& one, const std::string& other, int signal = SIGKILL) {
  int killed = 0;
  std::error_code failed;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", failed)) {
    const std::string name = entry.path().filename(), command = contentOf(entry.path() / "cmdline");
    if (name.find_first_not_of("0123456789") != std::string::npos || command.find(one) == std::string::npos ||
        command.find(other) == std::string::npos)
      continue;
    killed += ::kill(std::stoi(name), signal) == 0 ? 1 : 0;
  }
  return killed;
}

TEST(Session, StopsWhenANodeThatItNeedsEndsAndIsResumed) {
  const TemporaryFolder folder;
  setenv("ROS_HOSTNAME", "localhost", 1);
  const std::string home = folder.file("ros_home"), port = freePort();
  setenv("ROS_HOME", home.c_str(), 1);
  setenv("ROS_MASTER_URI", ("http://localhost:" + port).c_str(), 1);
  const auto session = [&](const std::string& name, const std::string& more) {
    return run("rosrun smartmill_launch run_launch --wait smartmill_launch session.launch model:=" MODEL
               " params:=" SHORT_SESSION " adaptive:=false summary:=" +
                   folder.file(name + ".json") + more,
               folder.file(name + ".log"));
  };
  std::thread graph([&] {
    run("roslaunch -p " + port +
            " smartmill_launch pipeline.launch pace:=3.0 database:=none port:=" + freePort(),
        folder.file("graph.log"));
  });
  std::atomic<bool> ended{false};
  int first_code = -1;
  std::thread first([&] {
    first_code = session("first", "");
    ended = true;
  });
  const bool measured = awaitText(folder.file("first.log"), "ok   FRF of the tool in x", ended);
  // The path of its log distinguishes it from the nodes of other tests.
  const int killed = killAll("__name:=loadmeter", home);
  first.join();
  const int second_code = session("second", " resume:=true");
  const int third_code = session("third", " resume:=true");
  killAll("pipeline.launch", port, SIGINT);
  graph.join();

  const std::string text = contentOf(folder.file("first.log"));
  ASSERT_TRUE(measured) << text << contentOf(folder.file("graph.log"));
  ASSERT_EQ(killed, 1);
  EXPECT_THAT(contentOf(folder.file("first.json")), HasSubstr("\"completed\": false"));
  EXPECT_THAT(text, HasSubstr("node /smartmill/loadmeter has ended"));
  EXPECT_THAT(text, HasSubstr("disarm motion"));
  EXPECT_THAT(text, Not(HasSubstr("FAIL disarm")));
  EXPECT_THAT(text, Not(HasSubstr("air cut")));

  const std::string resumed = contentOf(folder.file("second.log")),
                    summary = contentOf(folder.file("second.json"));
  EXPECT_THAT(resumed, HasSubstr("FRF of the tool in x: done before"));
  EXPECT_THAT(summary, HasSubstr("\"completed\": true"));
  EXPECT_THAT(summary, HasSubstr("\"point\": \"tool_tip\""));
  // roslaunch itself would return 0 each time.
  EXPECT_NE(first_code, 0);
  EXPECT_EQ(second_code, 0);
  EXPECT_NE(third_code, 0);
  EXPECT_THAT(contentOf(folder.file("third.log")), HasSubstr("no interrupted session in this launch"));
}

}  // namespace
