// Each node of the running graph is killed once: it comes back, its diagnostics with it, and a result that it
// had published on a latched topic.

#include <signal.h>

#include <cstdint>
#include <map>
#include <string>

#include <XmlRpc.h>
#include <actionlib/client/simple_action_client.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/ModalModel.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"

namespace {

using namespace smartmill;

constexpr double PATIENCE = 120.0;  // [s] for a busy computer

/// Process of a node, as it states itself. @return 0: no answer
int processOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, uri;
  request[0] = ros::this_node::getName();
  request[1] = node;
  std::string host;
  std::uint32_t port = 0;
  if (!ros::master::execute("lookupNode", request, response, uri, false) ||
      !ros::network::splitURI(static_cast<std::string>(uri), host, port))
    return 0;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue caller, answer;
  caller[0] = ros::this_node::getName();
  return client.execute("getPid", caller, answer) && answer.size() == 3 ? static_cast<int>(answer[2]) : 0;
}

/// Texts of the diagnostics of each node, newest.
class Diagnostics {
 public:
  explicit Diagnostics(ros::NodeHandle& nh)
      : subscriber_(nh.subscribe("/diagnostics", 1000, &Diagnostics::on, this)) {}
  /// Whether the node reported that it was restarted.
  bool restarted(const std::string& node) const {
    const auto text = restarts_.find(node);
    return text != restarts_.end() && text->second == "restarted 1 times in this launch";
  }
  bool has(const std::string& node) const { return restarts_.count(node) > 0; }

 private:
  void on(const diagnostic_msgs::DiagnosticArray& array) {
    for (const auto& status : array.status) {
      const std::size_t end = status.name.find(": restarts");
      if (end != std::string::npos) restarts_["/" + status.name.substr(0, end)] = status.message;
    }
  }
  std::map<std::string, std::string> restarts_;
  ros::Subscriber subscriber_;
};

TEST(Respawn, EachNodeComesBackWithWhatItHadPublished) {
  ros::NodeHandle nh("smartmill");
  Diagnostics diagnostics(nh);
  std::size_t blocks = 0;
  const boost::function<void(const smartmill_msgs::ForceBlock&)> on_block =
      [&](const smartmill_msgs::ForceBlock&) { ++blocks; };
  const ros::Subscriber forces =
      nh.subscribe<smartmill_msgs::ForceBlock>(names::FORCE_COMPENSATED, 100, on_block);
  ASSERT_TRUE(eventually([&] { return blocks > 10; }, ros::spinOnce));

  // A result of kalman: modes of the force sensor in y.
  actionlib::SimpleActionClient<smartmill_msgs::MeasureFrfAction> measure(
      names::absolute(names::MEASURE_SENSOR_FRF), true);
  ASSERT_TRUE(measure.waitForServer(ros::Duration(PATIENCE)));
  smartmill_msgs::MeasureFrfGoal goal;
  goal.header.stamp = ros::Time::now();
  goal.point = "force_sensor";
  goal.direction = "y";
  goal.hits = 3;
  goal.modes = 1;
  measure.sendGoal(goal);
  ASSERT_TRUE(eventually([&] { return measure.getState().isDone(); }, ros::spinOnce));
  ASSERT_EQ(measure.getResult()->code, smartmill_msgs::MeasureFrfResult::OK) << measure.getResult()->message;
  const ros::Time measured = measure.getResult()->modes.header.stamp;

  for (const char* name : {"kalman", "hammer", "loadmeter", "stability", "cnc"}) {
    const std::string node = names::absolute(name);
    ASSERT_TRUE(eventually([&] { return diagnostics.has(node); }, ros::spinOnce)) << node;
    EXPECT_FALSE(diagnostics.restarted(node)) << node;
    const int before = processOf(node);
    ASSERT_GT(before, 0) << node;
    ASSERT_EQ(::kill(before, SIGKILL), 0) << node;
    EXPECT_TRUE(eventually([&] { return diagnostics.restarted(node); }, ros::spinOnce))
        << node << " did not come back";
    EXPECT_NE(processOf(node), before) << node;
  }
  const int frames = processOf("/frames");  // a node without diagnostics
  ASSERT_GT(frames, 0);
  ASSERT_EQ(::kill(frames, SIGKILL), 0);
  EXPECT_TRUE(eventually(
      [&] {
        const int now = processOf("/frames");
        return now > 0 && now != frames;
      },
      ros::spinOnce));
  // Every topic flows again, and who subscribes now gets the latched results.
  const std::size_t before = blocks;
  EXPECT_TRUE(eventually([&] { return blocks > before + 10; }, ros::spinOnce));
  smartmill_msgs::ModalModel modes;
  const boost::function<void(const smartmill_msgs::ModalModel&)> on_modes =
      [&](const smartmill_msgs::ModalModel& m) { modes = m; };
  const ros::Subscriber latched = nh.subscribe<smartmill_msgs::ModalModel>(names::TOOL_MODES, 10, on_modes);
  EXPECT_TRUE(eventually([&] { return modes.direction == "y"; }, ros::spinOnce));
  EXPECT_EQ(modes.header.stamp, measured);
  bool has_condition = false;
  const boost::function<void(const smartmill_msgs::CuttingCondition&)> on_condition =
      [&](const smartmill_msgs::CuttingCondition&) { has_condition = true; };
  const ros::Subscriber conditions =
      nh.subscribe<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION, 10, on_condition);
  EXPECT_TRUE(eventually([&] { return has_condition; }, ros::spinOnce));
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "respawn_test");
  ros::NodeHandle keep_ros_running;
  ::testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
