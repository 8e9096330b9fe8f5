// A short session is recorded from the simulated machine; its replay must give the same results to the last
// digit.

#include <cstdlib>
#include <string>

#include <gtest/gtest.h>

#include "launched.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace {

using smartmill::TemporaryFolder;
using namespace smartmill::testing;

TEST(Replay, OfAShortSessionIsTheSameToTheLastDigit) {
  const TemporaryFolder folder;
  setenv("ROS_HOSTNAME", "localhost", 1);
  setenv("ROS_HOME", folder.file("ros_home").c_str(), 1);
  const std::string live = folder.file("live.bag"), again = folder.file("again.bag");
  const std::string summary = folder.file("session.json"), log = folder.file("log.txt");

  // A roslaunch that the launch test framework has not started needs a master of its own.
  run("roslaunch -p " + freePort() + " " SHORT_SESSION " port:=" + freePort() + " bag:=" + live +
          " summary:=" + summary,
      log);
  ASSERT_NE(contentOf(summary).find("\"completed\": true"), std::string::npos) << contentOf(log);
  run("roslaunch -p " + freePort() + " smartmill_launch replay.launch rate:=0 bag:=" + live +
          " out:=" + again,
      log);
  const std::string replayed = contentOf(log);
  const int code = run("rosrun smartmill_launch compare_bags " + live + " " + again, log);
  const std::string verdict = contentOf(log);
  EXPECT_EQ(code, 0) << verdict << replayed;
  for (const char* topic :
       {"tool/frf", "tool/modes", "material/coefficients", "force/measured", "force/compensated"}) {
    const std::size_t line = verdict.find(topic);
    ASSERT_NE(line, std::string::npos) << verdict;
    EXPECT_EQ(verdict.substr(line, 80).find(" 0 common"), std::string::npos) << verdict;
  }
}

}  // namespace
