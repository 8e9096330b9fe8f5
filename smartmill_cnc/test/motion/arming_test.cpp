#include "smartmill_cnc/motion/arming.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "smartmill_core/error.h"
#include "smartmill_core/testing/temporary_folder.h"

namespace fs = std::filesystem;

namespace smartmill::cnc {
namespace {

using ::testing::HasSubstr;

const std::optional<ArmHolder> SESSION = ArmHolder{"/smartmill/session", 1700000000.0};

TEST(Arming, ASecondClientIsRefusedWithTheHolderAndTheTime) {
  EXPECT_EQ(armRefusal({}, "/a"), "");
  EXPECT_EQ(armRefusal(SESSION, "/smartmill/session"), "");
  // date -u -d @1700000000
  EXPECT_EQ(
      armRefusal(SESSION, "/a"),
      "motion is armed by /smartmill/session since 2023-11-14 22:13:20 UTC; it has to be disarmed first");
}

TEST(Arming, OnlyTheHolderAndItsHelpersMove) {
  const std::vector<std::string> helpers{"/smartmill/hammer"};
  EXPECT_EQ(motionRefusal({}, "/a", helpers), "");  // the bridge refuses it as not armed
  EXPECT_EQ(motionRefusal(SESSION, "/smartmill/session", helpers), "");
  EXPECT_EQ(motionRefusal(SESSION, "/smartmill/hammer", helpers), "");
  EXPECT_EQ(motionRefusal(SESSION, "/a", helpers),
            "motion is armed by /smartmill/session since 2023-11-14 22:13:20 UTC, not by /a");
  EXPECT_THAT(motionRefusal(SESSION, "", helpers), HasSubstr("not by an unnamed client"));
}

TEST(Arming, TheClientOfAGoalIsInItsId) {
  EXPECT_EQ(clientOfGoal("/smartmill/session-3-1700000000.123456789"), "/smartmill/session");  // roscpp
  EXPECT_EQ(clientOfGoal("/rig_1-1-1700000000.5"), "/rig_1");                                  // rospy
  EXPECT_EQ(clientOfGoal("7"), "");
  EXPECT_EQ(clientOfGoal(""), "");
}

TEST(MotionLog, LinesAreAddedAndNoneIsLost) {
  const TemporaryFolder folder;
  const std::string file = folder.file("state/motion.log");
  MotionLog(file).write(1700000000.9, "/a", "arm: motion is armed");
  MotionLog(file).write(1700000001.0, "", "program x\n2000-01-01  /b  disarm");
  std::ifstream stream(file);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(stream), {}),
            "2023-11-14 22:13:20 UTC  /a  arm: motion is armed\n"
            "2023-11-14 22:13:21 UTC  an unnamed client  program x 2000-01-01  /b  disarm\n");
  EXPECT_NO_THROW(MotionLog("").write(0.0, "/a", "arm"));
  EXPECT_THROW(MotionLog("/dev/full").write(0.0, "/a", "arm"), Error);
  EXPECT_THROW(MotionLog(folder.file("state")), Error);
}

TEST(MotionLog, LinesThatAFullDiskRefusesAreWrittenLater) {
  const TemporaryFolder folder;
  const std::string file = folder.file("motion.log");
  fs::create_symlink("/dev/full", file);
  MotionLog log(file);
  EXPECT_THROW(log.write(1700000000.9, "/a", "arm: motion is armed"), Error);
  EXPECT_THROW(log.writeKept(), Error);
  fs::remove(file);
  log.write(1700000001.0, "/a", "program x");
  log.writeKept();
  std::ifstream stream(file);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(stream), {}),
            "2023-11-14 22:13:20 UTC  /a  arm: motion is armed\n"
            "2023-11-14 22:13:21 UTC  /a  program x\n");
}

}  // namespace
}  // namespace smartmill::cnc
