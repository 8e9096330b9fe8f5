#include <algorithm>
#include <atomic>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <actionlib_msgs/GoalStatus.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/ros.h>
#include <smartmill_msgs/MeasureFrfActionGoal.h>
#include <smartmill_msgs/MeasureFrfActionResult.h>
#include <smartmill_msgs/NodeHealth.h>
#include <smartmill_msgs/Strike.h>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_core/signal/stream_sorter.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_ros/follower.h"
#include "smartmill_ros/frf_server.h"
#include "smartmill_ros/latched_topic.h"
#include "smartmill_ros/node_shell.h"
#include "smartmill_ros/strike_client.h"

namespace smartmill {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(NodeShell, ALoopbackHostIsKnownByItsName) {
  for (const char* host : {"localhost", "127.0.0.1", "127.0.1.1", "::1"})
    EXPECT_TRUE(isLoopback(host)) << host;
  for (const char* host : {"", "mill-07", "192.0.2.7", "localhost.example", "1127.0.0.1"})
    EXPECT_FALSE(isLoopback(host)) << host;
}

TEST(NodeShell, AnExceptionOfAHandlerIsReportedAndTheNodeContinues) {
  ros::NodeHandle nh, private_nh("~");
  NodeShell shell(nh, private_nh, "none", 1.0);
  int accepted = 0, task_calls = 0;
  shell.inputs().on<smartmill_msgs::SpindleAngle>(
      names::SPINDLE_ANGLE, [&](const smartmill_msgs::SpindleAngle& m, double received) {
        if (m.speed < 0.0) throw Error("speed is below 0");
        EXPECT_GT(received, 0.0);
        ++accepted;
      });
  shell.every(0.01, [&] {
    ++task_calls;
    throw Error("task failed");
  });
  std::string reported;
  const boost::function<void(const diagnostic_msgs::DiagnosticArray&)> listen =
      [&](const diagnostic_msgs::DiagnosticArray& array) {
        for (const auto& status : array.status) {
          if (status.level == diagnostic_msgs::DiagnosticStatus::ERROR)
            reported = status.name + ": " + status.message;
        }
      };
  const ros::Subscriber diagnostics =
      nh.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10, listen);
  ros::Publisher angle = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 10);
  ASSERT_TRUE(eventually([&] { return angle.getNumSubscribers() == 1 && diagnostics.getNumPublishers() > 0; },
                         ros::spinOnce));
  EXPECT_FALSE(shell.inputs().any().ever());
  smartmill_msgs::SpindleAngle message;
  message.speed = -1.0;
  angle.publish(message);
  ASSERT_TRUE(eventually([&] { return !reported.empty(); }, ros::spinOnce));
  EXPECT_THAT(reported, HasSubstr("inputs"));
  EXPECT_THAT(reported, HasSubstr("spindle/angle: speed is below 0"));
  EXPECT_EQ(accepted, 0);
  message.speed = 1.0;
  angle.publish(message);
  EXPECT_TRUE(eventually([&] { return accepted == 1; }, ros::spinOnce));
  EXPECT_TRUE(shell.inputs().watchdog(names::SPINDLE_ANGLE).ever());
  EXPECT_THROW(shell.inputs().watchdog(names::CNC_STATE), std::out_of_range);
  EXPECT_TRUE(eventually([&] { return task_calls > 3; }, ros::spinOnce));
  // The end of data is reported once.
  int ends = 0;
  EXPECT_TRUE(eventually([&] { return (ends += shell.inputs().any().ended()) > 0; }, ros::spinOnce));
  EXPECT_EQ(ends, 1);
  const InputHealth* dead = shell.inputs().dead({names::SPINDLE_ANGLE});
  ASSERT_NE(dead, nullptr);
  EXPECT_EQ(dead->topic(), names::SPINDLE_ANGLE);
}

TEST(Inputs, FaultsAreReportedUnderTheTopicAtFault) {
  ros::NodeHandle nh, private_nh("~");
  NodeShell shell(nh, private_nh, "none", 1.0);
  std::vector<SampleBlock> blocks;
  shell.inputs().on<FramedBlock>(names::DYNAMOMETER, [&](const FramedBlock& framed, double) {
    EXPECT_EQ(framed.frame, "dynamometer");
    blocks.push_back(framed.block);
  });
  // A block that had waited is released by an angle, and found to be wrong.
  shell.inputs().on<SpindleAngle>(names::SPINDLE_ANGLE, [](const SpindleAngle&, double) {
    throw StreamError(names::DYNAMOMETER, "channel fz is missing");
  });
  std::string reported;
  const boost::function<void(const diagnostic_msgs::DiagnosticArray&)> listen =
      [&](const diagnostic_msgs::DiagnosticArray& array) {
        for (const auto& status : array.status) {
          if (status.level == diagnostic_msgs::DiagnosticStatus::ERROR) reported = status.message;
        }
      };
  const ros::Subscriber diagnostics =
      nh.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10, listen);
  ros::Publisher force = nh.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 10);
  ros::Publisher angle = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 10);
  ASSERT_TRUE(eventually(
      [&] {
        return force.getNumSubscribers() == 1 && angle.getNumSubscribers() == 1 &&
               diagnostics.getNumPublishers() > 0;
      },
      ros::spinOnce));
  SampleBlock block;
  block.stamp = 100.0;
  block.sample_rate = 1000.0;
  block.channels = {"fx"};
  block.units = {"N"};
  block.samples = {1.0, 1e30, 3.0};
  force.publish(toMsg(block, "dynamometer"));
  force.publish(toMsg(block, "dynamometer"));
  ASSERT_TRUE(eventually([&] { return !reported.empty(); }, ros::spinOnce));
  EXPECT_THAT(reported,
              HasSubstr("daq/dynamometer: channel fx has values that are not finite or beyond 1e9"));
  ASSERT_EQ(blocks.size(), 1u);  // the second is the first once more
  EXPECT_TRUE(std::isnan(blocks[0].samples[1]));
  EXPECT_EQ(blocks[0].samples[2], 3.0);
  reported.clear();
  angle.publish(toMsg(SpindleAngle{100.0, 0.0, 0.0}));
  EXPECT_TRUE(
      eventually([&] { return reported.find("daq/dynamometer: channel fz is missing") != std::string::npos; },
                 ros::spinOnce));
  EXPECT_THAT(reported, Not(HasSubstr("spindle/angle")));
}

TEST(Inputs, AStreamThatStopsIsBehindTheOthers) {
  ros::NodeHandle nh, private_nh("~");
  NodeShell shell(nh, private_nh, "none", 1.0);
  int taken = 0;
  const std::vector<const char*> topics{"daq/a", "daq/b", "daq/c"};
  std::vector<ros::Publisher> publishers;
  for (const char* topic : topics) {
    shell.inputs().on<SampleBlock>(topic, [&](const SampleBlock&, double) { ++taken; });
    publishers.push_back(nh.advertise<smartmill_msgs::SampleBlock>(topic, 1000));
  }
  std::string reported;
  const boost::function<void(const diagnostic_msgs::DiagnosticArray&)> listen =
      [&](const diagnostic_msgs::DiagnosticArray& array) {
        for (const auto& status : array.status) {
          if (status.name.find("inputs") != std::string::npos && status.level > 0) reported = status.message;
        }
      };
  const ros::Subscriber diagnostics =
      nh.subscribe<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10, listen);
  ASSERT_TRUE(eventually(
      [&] {
        return std::all_of(publishers.begin(), publishers.end(),
                           [](const ros::Publisher& p) { return p.getNumSubscribers() == 1; }) &&
               diagnostics.getNumPublishers() > 0;
      },
      ros::spinOnce));
  SampleBlock block;
  block.sample_rate = 100.0;
  block.channels = {"x"};
  block.units = {"N"};
  int sent = 0;
  for (int k = 0; reported.empty() && k < 100000; ++k) {
    block.stamp = 100.0 + 0.01 * k;
    block.first_index = static_cast<std::uint64_t>(k);
    block.samples = {0.1 * k};
    for (std::size_t t = 0; t < topics.size(); ++t) {
      if (t == 1 && k >= 100) continue;
      publishers[t].publish(toMsg(block));
      ++sent;
    }
    ASSERT_TRUE(eventually([&] { return taken == sent; }, ros::spinOnce));
  }
  EXPECT_THAT(reported, HasSubstr("daq/b: "));
  EXPECT_THAT(reported, HasSubstr("s behind the other inputs"));
  EXPECT_THAT(reported, Not(HasSubstr("daq/a")));
}

// By the running index of the samples one block comes twice, and 40 samples are missing.
TEST(NodeShell, AccountsForEveryMessage) {
  ros::NodeHandle nh, private_nh("~");
  NodeShell shell(nh, private_nh, "none", 1.0);
  std::uint64_t handled = 0;
  shell.inputs().on<FramedBlock>(names::DYNAMOMETER, [&](const FramedBlock&, double) { ++handled; });
  smartmill_msgs::NodeHealth health;
  const boost::function<void(const smartmill_msgs::NodeHealth&)> listen =
      [&](const smartmill_msgs::NodeHealth& m) { health = m; };
  const ros::Subscriber subscriber = nh.subscribe<smartmill_msgs::NodeHealth>(names::NODE_HEALTH, 10, listen);
  ros::Publisher force = nh.advertise<smartmill_msgs::SampleBlock>(names::DYNAMOMETER, 10);
  ASSERT_TRUE(eventually([&] { return force.getNumSubscribers() == 1 && subscriber.getNumPublishers() > 0; },
                         ros::spinOnce));
  SampleBlock block;
  block.sample_rate = 1000.0;
  block.channels = {"fx"};
  block.units = {"N"};
  block.samples.assign(10, 0.0);
  for (const std::uint64_t first : {0, 10, 20, 20, 70}) {
    block.first_index = first;
    block.stamp = 100.0 + 0.001 * static_cast<double>(first);
    for (double& value : block.samples) value += 1.0;
    force.publish(toMsg(block, "dynamometer"));
  }
  ASSERT_TRUE(
      eventually([&] { return !health.inputs.empty() && health.inputs[0].received == 5; }, ros::spinOnce));
  const smartmill_msgs::StreamHealth& input = health.inputs[0];
  EXPECT_EQ(health.node, ros::this_node::getName());
  EXPECT_EQ(input.topic, "/smartmill/daq/dynamometer");
  EXPECT_EQ(input.publishers, 1u);
  EXPECT_EQ(input.lost, 0u);
  EXPECT_EQ(input.dropped, 1u);
  EXPECT_EQ(input.processed, 4u);
  EXPECT_EQ(handled, 4u);
  EXPECT_EQ(input.lost_samples, 40u);
  EXPECT_GT(health.memory, 1e6);
  EXPECT_GT(health.threads, 1u);
  EXPECT_GT(health.descriptors, 3u);
  EXPECT_NEAR(health.started, ros::WallTime::now().toSec(), 600.0);
}

TEST(KeptMessages, OutliveTheirNodeUntilTheyAreForgotten) {
  ros::NodeHandle nh;
  smartmill_msgs::Frf frf;
  frf.direction = "x";
  frf.header.stamp = ros::Time(12.5);
  frf.real = {1.0, std::nan(""), -1e-300};
  {
    LatchedTopic<smartmill_msgs::Frf> topic(nh, "kept/frf");
    EXPECT_TRUE(topic.messages().empty());
    topic.publish("x", frf);
  }
  {
    LatchedTopic<smartmill_msgs::Frf> topic(nh, "kept/frf");
    ASSERT_EQ(topic.messages().size(), 1u);
    const smartmill_msgs::Frf& again = topic.messages().at("x");
    EXPECT_EQ(again.direction, "x");
    EXPECT_EQ(again.header.stamp, frf.header.stamp);
    EXPECT_EQ(again.real[2], -1e-300);
    EXPECT_TRUE(std::isnan(again.real[1]));
    topic.forget();
  }
  EXPECT_TRUE(LatchedTopic<smartmill_msgs::Frf>(nh, "kept/frf").messages().empty());
  // Of another message, or damaged.
  KeptTexts(nh, "kept/frf").keep("x", "*:00");
  EXPECT_TRUE(LatchedTopic<smartmill_msgs::Frf>(nh, "kept/frf").messages().empty());
  EXPECT_EQ(bytesOf("0aff"), (std::vector<std::uint8_t>{10, 255}));
  EXPECT_TRUE(bytesOf("0ag").empty());
}

TEST(Followers, APlayerLosesNoMessageAndItsPausesAreNoEnd) {
  ros::NodeHandle nh, private_nh("~");
  NodeShell shell(nh, private_nh, "none", 0.1);
  std::vector<double> taken;
  std::atomic<int> ticks{0}, ends{0};
  shell.inputs().on<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE,
                                                  [&](const smartmill_msgs::SpindleAngle& m, double) {
                                                    taken.push_back(m.angle);
                                                    ros::WallDuration(1e-4).sleep();
                                                  });
  shell.every(0.01, [&] {
    ++ticks;
    ends += shell.inputs().any().ended();
  });
  const auto publisher = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 600);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  Followers followers({ros::this_node::getName()});
  followers.begin();
  followers.expect(publisher);
  smartmill_msgs::SpindleAngle message;
  // More than the queue of the publisher, faster than the node processes them.
  for (int i = 0; i < 5000; ++i) {
    message.angle = i;
    followers.publish(publisher, message);
  }
  followers.settle();
  EXPECT_EQ(taken.size(), 5000u);
  EXPECT_TRUE(std::is_sorted(taken.begin(), taken.end()));
  const int since = ticks;
  while (ticks < since + 50) ros::WallDuration(0.01).sleep();  // five times the timeout
  EXPECT_EQ(ends, 0);
  followers.end();
  EXPECT_EQ(ends, 1);
  EXPECT_THROW(Followers({"/no_node"}).begin(0.1), Error);
  spinner.stop();
}

TEST(LatchedTopic, ALateSubscriberGetsTheLastOfEveryKey) {
  ros::NodeHandle nh;
  LatchedTopic<smartmill_msgs::Frf> topic(nh, names::TOOL_FRF);
  smartmill_msgs::Frf frf;
  for (const char* direction : {"x", "y", "x"}) {
    frf.direction = direction;
    frf.header.stamp += ros::Duration(1.0);
    topic.publish(direction, frf);
  }
  std::map<std::string, double> received;
  const boost::function<void(const smartmill_msgs::Frf&)> listen = [&](const smartmill_msgs::Frf& m) {
    received[m.direction] = m.header.stamp.toSec();
  };
  const ros::Subscriber subscriber = nh.subscribe<smartmill_msgs::Frf>(names::TOOL_FRF, 10, listen);
  ASSERT_TRUE(eventually([&] { return received.size() == 2; }, ros::spinOnce));
  EXPECT_EQ(received["x"], 3.0);
  EXPECT_EQ(received["y"], 2.0);
}

// Client of an action without actionlib.
class Client {
 public:
  explicit Client(ros::NodeHandle& nh)
      : goals_(nh.advertise<smartmill_msgs::MeasureFrfActionGoal>(names::goals("test/measure_frf"), 10)),
        cancels_(nh.advertise<actionlib_msgs::GoalID>("test/measure_frf/cancel", 10)) {
    const boost::function<void(const smartmill_msgs::MeasureFrfActionResult&)> listen =
        [this](const smartmill_msgs::MeasureFrfActionResult& m) { results[m.status.goal_id.id] = m; };
    results_ = nh.subscribe<smartmill_msgs::MeasureFrfActionResult>("test/measure_frf/result", 10, listen);
  }
  bool connected() const {
    return goals_.getNumSubscribers() > 0 && cancels_.getNumSubscribers() > 0 &&
           results_.getNumPublishers() > 0;
  }
  void send(const std::string& id) {
    smartmill_msgs::MeasureFrfActionGoal goal;
    goal.goal_id.id = id;
    goal.goal.direction = id;
    goals_.publish(goal);
  }
  void cancel(const std::string& id) {
    actionlib_msgs::GoalID goal;
    goal.id = id;
    cancels_.publish(goal);
  }
  int statusOf(const std::string& id) { return results.count(id) ? results[id].status.status : -1; }

  std::map<std::string, smartmill_msgs::MeasureFrfActionResult> results;

 private:
  ros::Publisher goals_, cancels_;
  ros::Subscriber results_;
};

TEST(FrfServer, MeasuresOneGoalAtATimeAndAnswersEach) {
  using Status = actionlib_msgs::GoalStatus;
  ros::NodeHandle nh;
  std::map<std::string, std::function<bool(bool)>> begin;
  std::function<bool()> still_active;
  FrfServer server(
      nh, "test/measure_frf", "test",
      {[&](const MeasureFrfGoal& goal, std::function<bool(bool)> at) { begin[goal.direction] = at; },
       [&](std::function<bool()> query) { still_active = query; }});
  Client client(nh);
  ASSERT_TRUE(eventually([&] { return client.connected(); }, ros::spinOnce));
  for (const char* id : {"x", "y", "z"}) client.send(id);
  ASSERT_TRUE(eventually([&] { return begin.size() == 3; }, ros::spinOnce));
  EXPECT_TRUE(begin["x"](true));
  EXPECT_FALSE(begin["y"](false));  // another measurement is running
  EXPECT_TRUE(eventually([&] { return client.statusOf("y") == Status::REJECTED; }, ros::spinOnce));
  client.cancel("x");
  ASSERT_TRUE(eventually([&] { return static_cast<bool>(still_active); }, ros::spinOnce));
  EXPECT_TRUE(still_active());
  server.feedback("stage", 0.5, 3);
  FrfServer::Result result;
  result.message = "measured";
  result.frf.direction = "x";
  server.finish(result);
  EXPECT_FALSE(still_active());
  EXPECT_TRUE(eventually([&] { return client.statusOf("x") == Status::SUCCEEDED; }, ros::spinOnce));
  EXPECT_EQ(server.lastMessage(), "measured");

  server.refuseWaiting("daq/hammer is silent", 1e3);  // before the timeout
  server.refuseWaiting("daq/hammer is silent", 0.0);
  EXPECT_TRUE(eventually([&] { return client.statusOf("z") == Status::REJECTED; }, ros::spinOnce));
  EXPECT_EQ(client.results["z"].result.message, "daq/hammer is silent");
  EXPECT_FALSE(begin["z"](true));  // already answered

  client.send("again");
  ASSERT_TRUE(eventually([&] { return begin.count("again") > 0; }, ros::spinOnce));
  EXPECT_TRUE(begin["again"](true));
  server.restart();
  EXPECT_TRUE(eventually([&] { return client.statusOf("again") == Status::ABORTED; }, ros::spinOnce));
}

TEST(StrikeClient, ReturnsEachFaultOnce) {
  using Kind = StrikeClient::Answer::Kind;
  using Strike = smartmill_msgs::Strike;
  ros::NodeHandle nh;
  StrikeClient caller(nh, "tool");
  std::optional<StrikeClient::Answer> fault;
  const auto hasFault = [&] { return (fault = caller.takeFault()).has_value(); };
  caller.strike("x");
  ASSERT_TRUE(eventually([&] { return fault || hasFault(); }, ros::spinOnce));
  EXPECT_EQ(fault->kind, Kind::no_answer);

  std::string struck;
  std::uint8_t code = Strike::Response::OK;
  const boost::function<bool(Strike::Request&, Strike::Response&)> serve = [&](Strike::Request& request,
                                                                               Strike::Response& response) {
    struck = request.point + " " + request.direction;
    response.code = code;
    response.message = "message";
    return true;
  };
  const ros::ServiceServer server =
      nh.advertiseService<Strike::Request, Strike::Response>(names::STRIKE, serve);
  caller.strike("y");
  EXPECT_TRUE(eventually([&] { return struck == "tool y"; }, ros::spinOnce));
  EXPECT_FALSE(caller.takeFault());
  for (const auto& [answer, kind] :
       {std::pair<std::uint8_t, Kind>{Strike::Response::NO_HAMMER, Kind::no_hammer},
        {Strike::Response::FAILED, Kind::failed}}) {
    code = answer;
    // The answer to the previous call may still be on its way.
    do {
      fault.reset();
      caller.strike("z");
      ASSERT_TRUE(eventually([&] { return fault || hasFault(); }, ros::spinOnce));
    } while (fault->message == "daq/strike: the previous call is not answered yet");
    EXPECT_EQ(fault->kind, kind);
    EXPECT_EQ(fault->message, "daq/strike: message");
  }
}

}  // namespace
}  // namespace smartmill

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "shell_test");
  return RUN_ALL_TESTS();
}
