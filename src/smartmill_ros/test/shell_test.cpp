#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/kept_topic.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;

constexpr double PATIENCE = 30.0;  // [s], for a busy machine

template <class Condition>
bool eventually(Condition condition) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(PATIENCE);
  while (ros::ok() && !condition() && ros::WallTime::now() < end) {
    ros::spinOnce();
    ros::WallDuration(0.01).sleep();
  }
  return condition();
}

TEST(NodeShell, AHandlerThatThrowsLeavesADiagnosticAndTheNodeGoesOn) {
  ros::NodeHandle nh, private_nh("~");
  NodeShell shell(nh, private_nh, "none", 1.0);
  int good = 0, worked = 0;
  shell.inputs().on<smartmill_msgs::SpindleAngle>(
      names::SPINDLE_ANGLE, [&](const smartmill_msgs::SpindleAngle& m, double received) {
        if (m.speed < 0.0) throw Error("speed is below 0");
        EXPECT_GT(received, 0.0);
        ++good;
      });
  shell.every(0.01, [&] {
    ++worked;
    throw Error("work that fails");
  });
  std::string told;
  const boost::function<void(const diagnostic_msgs::DiagnosticArray&)> listen =
      [&](const diagnostic_msgs::DiagnosticArray& array) {
        for (const auto& status : array.status) {
          if (status.level == diagnostic_msgs::DiagnosticStatus::ERROR)
            told = status.name + ": " + status.message;
        }
      };
  const ros::Subscriber diagnostics =
      nh.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10, listen);
  ros::Publisher angle = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 10);
  ASSERT_TRUE(
      eventually([&] { return angle.getNumSubscribers() == 1 && diagnostics.getNumPublishers() > 0; }));
  EXPECT_FALSE(shell.inputs().any().ever());
  smartmill_msgs::SpindleAngle message;
  message.speed = -1.0;
  angle.publish(message);
  ASSERT_TRUE(eventually([&] { return !told.empty(); }));
  EXPECT_THAT(told, HasSubstr("inputs"));
  EXPECT_THAT(told, HasSubstr("spindle/angle: speed is below 0"));
  EXPECT_EQ(good, 0);
  message.speed = 1.0;
  angle.publish(message);
  EXPECT_TRUE(eventually([&] { return good == 1; }));
  EXPECT_TRUE(shell.inputs().watchdog(names::SPINDLE_ANGLE).ever());
  EXPECT_THROW(shell.inputs().watchdog(names::CNC_STATE), std::out_of_range);
  EXPECT_TRUE(eventually([&] { return worked > 3; }));
  // Silence: told once.
  int ends = 0;
  EXPECT_TRUE(eventually([&] { return (ends += shell.inputs().any().ended(Inputs::now())) > 0; }));
  EXPECT_EQ(ends, 1);
  const InputHealth* dead = shell.inputs().dead({names::SPINDLE_ANGLE});
  ASSERT_NE(dead, nullptr);
  EXPECT_EQ(dead->topic(), names::SPINDLE_ANGLE);
}

TEST(KeptTopic, ALateSubscriberGetsTheLastOfEveryKey) {
  ros::NodeHandle nh;
  KeptTopic<smartmill_msgs::Frf> topic(nh, names::TOOL_FRF);
  smartmill_msgs::Frf frf;
  for (const char* direction : {"x", "y", "x"}) {
    frf.direction = direction;
    frf.header.stamp += ros::Duration(1.0);
    topic.publish(direction, frf);
  }
  std::map<std::string, double> got;
  const boost::function<void(const smartmill_msgs::Frf&)> listen = [&](const smartmill_msgs::Frf& m) {
    got[m.direction] = m.header.stamp.toSec();
  };
  const ros::Subscriber subscriber = nh.subscribe<smartmill_msgs::Frf>(names::TOOL_FRF, 10, listen);
  ASSERT_TRUE(eventually([&] { return got.size() == 2; }));
  EXPECT_EQ(got["x"], 3.0);
  EXPECT_EQ(got["y"], 2.0);
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "shell_test");
  return RUN_ALL_TESTS();
}
