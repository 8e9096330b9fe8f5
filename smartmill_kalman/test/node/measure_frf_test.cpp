// Wiring of kalman_node: taps against the closed-form rig, a cut with the modes found, and the recorded bag
// through the offline tool's class and through a second node in replay: every digit.

#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <string>

#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/Frf.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/ModalModel.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <tf2_msgs/TFMessage.h>
#include <topic_tools/shape_shifter.h>

#include "recordings/bag_compensation.h"
#include "smartmill_core/error.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/testing/temporary_folder.h"
#include "smartmill_core/units.h"
#include "smartmill_ros/follower.h"
#include "smartmill_ros/parameter_server.h"

namespace smartmill::kalman {
namespace {

/// Goals and conditions are sent ahead, so that they are in order on a busy machine.
const ros::Duration LEAD(2.0);

using Client = actionlib::SimpleActionClient<smartmill_msgs::MeasureFrfAction>;
using Blocks = std::map<std::uint64_t, smartmill_msgs::ForceBlock>;

class MeasureFrf : public testing::Test {
 protected:
  MeasureFrf() : client(names::MEASURE_SENSOR_FRF, true), spinner(2) {
    condition = nh.advertise<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION, 0, true);
    spinner.start();
  }

  template <class Message>
  void record(const std::string& topic) {
    const boost::function<void(const boost::shared_ptr<const Message>&)> write =
        [this, topic](const boost::shared_ptr<const Message>& m) {
          const std::lock_guard<std::mutex> lock(mutex);
          ++messages[topic];
          if (bag.isOpen()) bag.write(topic[0] == '/' ? topic : "/smartmill/" + topic, ros::Time::now(), *m);
        };
    subscribers.push_back(nh.subscribe<Message>(topic, 0, write));
  }
  void collect(const std::string& topic, Blocks& blocks) {
    const boost::function<void(const smartmill_msgs::ForceBlock&)> take =
        [this, &blocks](const smartmill_msgs::ForceBlock& m) {
          const std::lock_guard<std::mutex> lock(mutex);
          blocks[m.first_index] = m;
        };
    subscribers.push_back(nh.subscribe<smartmill_msgs::ForceBlock>(topic, 0, take));
  }

  smartmill_msgs::MeasureFrfResult measure(const std::string& direction, std::uint32_t hits) {
    smartmill_msgs::MeasureFrfGoal goal;
    goal.header.stamp = ros::Time::now() + LEAD;
    goal.point = POINT_FORCE_SENSOR;
    goal.direction = direction;
    goal.hits = hits;
    client.sendGoal(goal, {}, {}, [this](const smartmill_msgs::MeasureFrfFeedbackConstPtr& m) {
      const std::lock_guard<std::mutex> lock(mutex);
      said += m->stage + "\n";
    });
    if (!client.waitForResult(ros::Duration(120.0))) throw Error("no result");
    return *client.getResult();
  }

  ros::NodeHandle nh;
  Client client;
  ros::AsyncSpinner spinner;
  ros::Publisher condition;
  std::mutex mutex;
  rosbag::Bag bag;
  std::map<std::string, int> messages;
  std::string said;
  Blocks live, again;
  std::set<std::string> directions;  // of modes that a late subscriber got
  std::vector<ros::Subscriber> subscribers;
};

/// Share of the blocks that the other side has with the same numbers; all of `some` that `all` holds are
/// compared.
void expectSame(const Blocks& some, const Blocks& all, std::size_t least) {
  std::size_t compared = 0;
  for (const auto& [index, block] : some) {
    const auto other = all.find(index);
    if (other == all.end()) continue;
    ASSERT_EQ(block.fx, other->second.fx) << index;
    ASSERT_EQ(block.fy, other->second.fy) << index;
    ASSERT_EQ(block.fz, other->second.fz) << index;
    ASSERT_EQ(block.status, other->second.status) << index;
    ++compared;
  }
  EXPECT_GE(compared, least);
}

TEST_F(MeasureFrf, TapsThenCutsAndReplaysToTheLastDigit) {
  ASSERT_TRUE(client.waitForServer(ros::Duration(120.0)));
  const TemporaryFolder temporary;
  const std::string file = temporary.file("smartmill_kalman_measure_frf_test.bag");
  bag.open(file, rosbag::bagmode::Write);
  collect(names::FORCE_COMPENSATED, live);
  collect("again/force/compensated", again);
  record<tf2_msgs::TFMessage>("/tf_static");
  record<smartmill_msgs::SampleBlock>(names::HAMMER);
  record<smartmill_msgs::SampleBlock>(names::DYNAMOMETER);
  record<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE);
  record<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION);
  record<smartmill_msgs::MeasureFrfActionGoal>(names::goals(names::MEASURE_SENSOR_FRF));
  ASSERT_TRUE(eventually([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return messages[names::HAMMER] > 10 && messages[names::DYNAMOMETER] > 10 &&
           messages[names::SPINDLE_ANGLE] > 10 && messages["/tf_static"] > 0 && live.size() > 10;
  }));

  std::map<std::string, smartmill_msgs::MeasureFrfResult> results;
  for (const char* direction : {"x", "y"}) {
    const auto result = results[direction] = measure(direction, 4);
    ASSERT_EQ(result.code, smartmill_msgs::MeasureFrfResult::OK) << result.message;
    ASSERT_EQ(result.modes.modes.size(), 1u);
    EXPECT_NEAR(result.modes.modes[0].frequency, 930.0, 0.002 * 930.0);
    EXPECT_NEAR(result.modes.modes[0].gain, 0.9, 0.02);
    EXPECT_TRUE(std::isnan(result.sensitivity));
    EXPECT_EQ(result.frf.unit, "1");
  }
  // No hammer strikes in z, and there is no hit by hand.
  const auto z = measure("z", 1);
  EXPECT_EQ(z.code, smartmill_msgs::MeasureFrfResult::NO_HIT);
  EXPECT_NE(said.find("by hand"), std::string::npos) << said;
  EXPECT_EQ(measure("u", 1).code, smartmill_msgs::MeasureFrfResult::BAD_GOAL);

  // Late subscribers get both directions.
  const boost::function<void(const smartmill_msgs::ModalModel&)> note =
      [&](const smartmill_msgs::ModalModel& m) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (m.point == POINT_FORCE_SENSOR) directions.insert(m.direction);
      };
  subscribers.push_back(nh.subscribe<smartmill_msgs::ModalModel>(names::TOOL_MODES, 10, note));
  EXPECT_TRUE(eventually([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return directions.size() == 2;
  }));

  smartmill_msgs::CuttingCondition cut;
  cut.header.stamp = ros::Time::now() + LEAD;
  cut.kind = smartmill_msgs::CuttingCondition::CUT;
  cut.name = "slot_9000";
  cut.teeth = 4;
  cut.diameter = 19.05e-3;
  cut.helix = units::radFromDeg(30.0);
  cut.spindle_speed = units::radPerSecFromRpm(9000.0);
  cut.feed_per_tooth = 6e-5;
  cut.axial_depth = 2e-3;
  cut.exit_angle = units::PI;
  condition.publish(cut);
  // By the rig's samples, however late they are.
  const auto milled = [&](const ros::Time& until) {
    return eventually([&] {
      const std::lock_guard<std::mutex> lock(mutex);
      return live.rbegin()->second.header.stamp > until;
    });
  };
  ASSERT_TRUE(milled(cut.header.stamp + ros::Duration(1.5)));
  smartmill_msgs::CuttingCondition none;
  none.header.stamp = ros::Time::now() + LEAD;
  condition.publish(none);
  ASSERT_TRUE(milled(none.header.stamp + ros::Duration(0.5)));
  std::uint64_t last = 0;
  {
    const std::lock_guard<std::mutex> lock(mutex);
    bag.close();
    last = live.rbegin()->first;  // the rig goes on
  }

  // Offline, from the bag.
  // With the live node's own parameters.
  const auto parameters =
      parametersFromServer(ros::NodeHandle("/smartmill/kalman")).readAll<NodeParameters>();
  std::vector<BagCut> cuts;
  const BagSummary summary = compensateBag(file, ForceSensor(), parameters, Method::kalman, {},
                                           [&](BagCut&& c) { cuts.push_back(std::move(c)); });
  ASSERT_EQ(cuts.size(), 1u);
  EXPECT_TRUE(summary.rotation_known);
  ASSERT_EQ(summary.identified.size(), 4u);
  EXPECT_EQ(summary.identified[0].modes.model.modes[0].frequency, results["x"].modes.modes[0].frequency);
  const BagCut& offline = cuts[0];
  EXPECT_EQ(offline.name, "slot_9000");
  EXPECT_NEAR(offline.offset.back(), (none.header.stamp - cut.header.stamp).toSec(), 0.02);
  std::size_t same = 0;
  const double start = cut.header.stamp.toSec();
  {
    const std::lock_guard<std::mutex> lock(mutex);
    std::size_t at = 0;
    for (const auto& [index, block] : live) {
      for (std::size_t i = 0; i < block.fx.size(); ++i) {
        const double time = block.header.stamp.toSec() + static_cast<double>(i) / block.sample_rate;
        if (time < start || at >= offline.offset.size()) continue;
        // The filters begin anew with the first whole block after the condition.
        if (block.header.stamp.toSec() < start) {
          ++at;
          continue;
        }
        ASSERT_EQ(block.fx[i], offline.compensated[0][at]) << at;
        ASSERT_EQ(block.fy[i], offline.compensated[1][at]) << at;
        ++at, ++same;
      }
    }
  }
  EXPECT_GT(same, 30000u);

  // The smoother, from the same bag, agrees but for the noise.
  compensateBag(file, ForceSensor(), parameters, Method::smoother, {},
                [&](BagCut&& c) { cuts.push_back(std::move(c)); });
  ASSERT_EQ(cuts.size(), 2u);
  double difference = 0.0, norm = 0.0;
  for (std::size_t i = 12800; i < 25600; ++i) {
    difference += std::pow(cuts[1].compensated[0][i] - cuts[0].compensated[0][i], 2);
    norm += std::pow(cuts[1].compensated[0][i], 2);
  }
  EXPECT_GT(difference, 0.0);
  EXPECT_LT(std::sqrt(difference / norm), 0.05);

  // The second node, driven by the recorded messages.
  std::map<std::string, ros::Publisher> out;
  rosbag::Bag recorded(file, rosbag::bagmode::Read);
  rosbag::View view(recorded);
  for (const rosbag::ConnectionInfo* c : view.getConnections()) {
    if (c->topic.rfind("/smartmill/", 0) != 0) continue;
    std::string topic = c->topic;
    topic.insert(std::string("/smartmill/").size(), "again/");
    if (c->datatype == "smartmill_msgs/SampleBlock") {
      out[c->topic] = nh.advertise<smartmill_msgs::SampleBlock>(topic, 0);
    } else if (c->datatype == "smartmill_msgs/SpindleAngle") {
      out[c->topic] = nh.advertise<smartmill_msgs::SpindleAngle>(topic, 0);
    } else if (c->datatype == "smartmill_msgs/CuttingCondition") {
      out[c->topic] = nh.advertise<smartmill_msgs::CuttingCondition>(topic, 0);
    } else if (c->datatype == "smartmill_msgs/MeasureFrfActionGoal") {
      out[c->topic] = nh.advertise<smartmill_msgs::MeasureFrfActionGoal>(topic, 0);
    }
  }
  ASSERT_EQ(out.size(), 5u);
  Followers node({names::absolute("again/kalman")});
  node.begin();
  for (const auto& entry : out) node.expect(entry.second);
  for (const rosbag::MessageInstance& m : view) {
    const auto publisher = out.find(m.getTopic());
    if (publisher == out.end()) continue;
    node.publish(publisher->second, m);
    // Goals and conditions are there before what comes after them.
    if (m.isType<smartmill_msgs::CuttingCondition>() || m.isType<smartmill_msgs::MeasureFrfActionGoal>())
      node.settle();
  }
  node.end();
  ASSERT_TRUE(eventually([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return !again.empty() && again.rbegin()->first + 20 * 256 >= last;
  }));
  {
    const std::lock_guard<std::mutex> lock(mutex);
    // From the cut on: before it the live node had received more.
    while (!again.empty() && again.begin()->second.header.stamp < cut.header.stamp)
      again.erase(again.begin());
    expectSame(again, live, 120);
  }
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace smartmill::kalman

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "measure_frf_test");
  return RUN_ALL_TESTS();
}
