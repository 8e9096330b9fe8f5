// The frames of a model file on /tf_static.
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>

#include <cmath>

namespace smartmill::cnc {
namespace {

TEST(FramesNode, PublishesTheFramesOfTheModel) {
  tf2_ros::Buffer buffer;
  const tf2_ros::TransformListener listener(buffer);
  const auto found =
      buffer.lookupTransform("machine", "dynamometer", ros::Time(0), ros::Duration(120.0)).transform;
  EXPECT_NEAR(found.translation.x, 0.110, 1e-12);
  EXPECT_NEAR(found.translation.y, 0.020, 1e-12);
  EXPECT_NEAR(found.translation.z, 0.030, 1e-12);
  EXPECT_NEAR(found.rotation.z, std::sin(M_PI / 12.0), 1e-12);
  EXPECT_NEAR(found.rotation.w, std::cos(M_PI / 12.0), 1e-12);
  EXPECT_TRUE(buffer.canTransform("spindle", "tool_tip", ros::Time(0), ros::Duration(10.0)));
  EXPECT_TRUE(buffer.canTransform("machine", "hammer", ros::Time(0), ros::Duration(10.0)));
}

}  // namespace
}  // namespace smartmill::cnc

int main(int argc, char** argv) {
  ros::init(argc, argv, "frames_node_test");
  const ros::NodeHandle keeps_alive;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
