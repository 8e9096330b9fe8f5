#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/names.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/follower.h"
#include "smartmill_stability_testing/control_streams.h"

namespace smartmill::stability {
namespace {

TEST(ChatterControlNode, identifiesTheMachineFromItsStreams) {
  ros::NodeHandle nh;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  std::size_t commands = 0;
  const ros::Subscriber listener = nh.subscribe<smartmill_msgs::SampleBlock>(
      names::CONTROL_COMMAND, 0,
      boost::function<void(const smartmill_msgs::SampleBlock::ConstPtr&)>(
          [&](const auto& m) { commands += m->samples.size(); }));
  ros::Publisher angles = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 0);
  ros::Publisher blocks = nh.advertise<smartmill_msgs::SampleBlock>(names::DISPLACEMENT, 0);
  Followers node({names::absolute("chatter_control")});
  node.begin();
  node.expect(angles);
  node.expect(blocks);
  node.expect(listener);
  const TurningProcess process = kimProcess(2.0);
  node.publish(angles, toMsg(SpindleAngle{99.0, 0.0, units::TWO_PI / process.period}));
  node.settle();  // ROS does not preserve the order between topics
  for (const SampleBlock& block : displacementBlocks(process, 2.1, 100)) node.publish(blocks, toMsg(block));
  node.end();
  const auto machine = ros::topic::waitForMessage<smartmill_msgs::ModalModel>(names::CONTROL_MACHINE, nh,
                                                                              ros::Duration(120.0));
  ASSERT_TRUE(machine);
  ASSERT_EQ(machine->modes.size(), 1u);
  const ModalModel model = fromMsg(*machine).model;
  EXPECT_NEAR(model.modes[0].frequency * units::TWO_PI, 350.0, 3.5);
  EXPECT_NEAR(model.modes[0].damping_ratio, 0.02, 0.004);
  // All messages have arrived; the pending callbacks are called here.
  spinner.stop();
  ros::getGlobalCallbackQueue()->callAvailable();
  EXPECT_EQ(commands, 21000u);
}

}  // namespace
}  // namespace smartmill::stability

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "chatter_control_node_test");
  return RUN_ALL_TESTS();
}
