// A session on a machine without a hammer: the hammer node is not started and nothing waits for it; stability
// is learned from cuts.

#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "launched.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace {

using smartmill::TemporaryFolder;
using namespace smartmill::testing;
using ::testing::HasSubstr;
using ::testing::Not;

TEST(Session, LearnsStabilityFromCutsWithoutAHammer) {
  const TemporaryFolder folder;
  setenv("ROS_HOSTNAME", "localhost", 1);
  const std::string home = folder.file("ros_home"), port = freePort();
  setenv("ROS_HOME", home.c_str(), 1);
  setenv("ROS_MASTER_URI", ("http://localhost:" + port).c_str(), 1);
  const auto session = [&](const std::string& sensor, const std::string& log) {
    return run("roslaunch -p " + port + " smartmill_launch pipeline.launch session:=true hammer:=false" +
                   " pace:=3.0 database:=none tool_watch:=false motor_currents:=false sensor:=" + sensor +
                   " session_params:=" SESSION_PARAMETERS " summary:=" + folder.file("summary.json") +
                   " port:=" + freePort(),
               folder.file(log));
  };
  ASSERT_EQ(session("table", "table.log"), 0) << contentOf(folder.file("table.log"));
  const std::string log = contentOf(folder.file("table.log"));
  EXPECT_THAT(log, Not(HasSubstr("smartmill/hammer-")));
  EXPECT_THAT(log, Not(HasSubstr("FRF of the tool")));
  const auto summary = nlohmann::json::parse(contentOf(folder.file("summary.json")));
  EXPECT_TRUE(summary.at("completed"));
  EXPECT_TRUE(summary.at("modes").empty());
  const std::size_t cuts = summary.at("probing_cuts").size();
  ASSERT_GE(cuts, 2u);  // the slot tests first
  ASSERT_LE(cuts, 4u);
  EXPECT_TRUE(summary["probing_cuts"][0].at("probability_stable").is_null());
  for (std::size_t k = 1; k < cuts; ++k) {
    const auto& cut = summary["probing_cuts"][k];
    EXPECT_GT(cut.at("probability_stable"), 0.0) << cut;
    EXPECT_GE(cut.at("windows"), 2) << cut;
    if (cut.at("cut_is") == "chatter") {
      EXPECT_GT(cut.at("chatter_frequency_hz"), 50.0) << cut;
    }
  }
  const auto& best = summary.at("recommended_cut");
  EXPECT_GE(best.at("probability_stable"), 0.95) << best;
  ASSERT_EQ(summary.at("verified_cuts").size(), 1u);
  const auto& verified = summary["verified_cuts"][0];
  EXPECT_EQ(verified.at("cut_is"), "stable") << verified;
  EXPECT_TRUE(verified.at("as_predicted"));

  // A sensor that is calibrated by taps.
  session("plate", "plate.log");
  EXPECT_THAT(contentOf(folder.file("plate.log")), HasSubstr("hammer: false: sensor plate"));
}

}  // namespace
