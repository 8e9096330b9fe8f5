// A master is killed and a new one started on its port, while a node of this process and a subscriber of
// another process run.

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <ros/ros.h>
#include <ros/xmlrpc_manager.h>
#include <smartmill_msgs/Follow.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/names.h"
#include "smartmill_core/testing/eventually.h"
#include "smartmill_core/testing/free_port.h"
#include "smartmill_ros/follower.h"
#include "smartmill_ros/kept_messages.h"
#include "smartmill_ros/master_watch.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill {
namespace {

pid_t start(const std::vector<std::string>& words) {
  const pid_t child = ::fork();
  if (child != 0) return child;
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  ::execvp(arguments[0], arguments.data());
  ::_exit(127);
}

/// @return exit status
int end(pid_t child, int signal) {
  int status = 0;
  ::kill(child, signal);
  ::waitpid(child, &status, 0);
  return status;
}

TEST(MasterWatch, RegistersTheNodeAtANewMaster) {
  const std::string port = std::to_string(freePort());
  const std::vector<std::string> master{"rosmaster", "--core", "-p", port};
  ::setenv("ROS_MASTER_URI", ("http://localhost:" + port).c_str(), 1);
  ::setenv("ROS_HOSTNAME", "localhost", 1);
  pid_t running = start(master);
  int argc = 0;
  ros::init(argc, nullptr, "watched", ros::init_options::NoSigintHandler);
  ASSERT_TRUE(eventually([] { return ros::master::check(); }));
  ros::NodeHandle nh("smartmill"), private_nh("~");
  private_nh.setParam("depth", 2.5e-3);
  nh.setParam("kept/launch", "launch_7");
  KeptTexts(nh, "modes").keep("x", "930");
  {
    NodeShell shell(nh, private_nh, "none", 1.0);
    const MasterWatch watch(nh);
    std::atomic<int> received{0};
    shell.inputs().on<smartmill_msgs::SpindleAngle>(
        names::SPINDLE_ANGLE, [&](const smartmill_msgs::SpindleAngle&, double) { ++received; });
    const ros::Publisher angle = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 10);
    ros::AsyncSpinner spinner(1);
    spinner.start();
    ASSERT_TRUE(eventually([&] { return angle.getNumSubscribers() == 1; }));
    // Known to the master, with its parameters, for some seconds.
    ros::WallDuration(3.0).sleep();
    end(running, SIGKILL);
    ASSERT_TRUE(eventually([] { return !ros::master::check(); }));
    angle.publish(smartmill_msgs::SpindleAngle());
    EXPECT_TRUE(eventually([&] { return received == 1; }));  // without a master

    running = start(master);
    const std::string topic = names::absolute(names::SPINDLE_ANGLE),
                      service = "/watched/" + std::string(FOLLOW);
    EXPECT_TRUE(eventually([&] { return ros::service::exists(service, false); }));
    double depth = 0.0;
    EXPECT_TRUE(private_nh.getParam("depth", depth));
    EXPECT_EQ(depth, 2.5e-3);
    EXPECT_EQ(KeptTexts(nh, "modes").all(), (std::map<std::string, std::string>{{"x", "930"}}));
    // A process that started after the new master finds topic and service.
    EXPECT_EQ(std::system(("timeout 60 rosservice call " + service + " '{phase: 0}' > /dev/null").c_str()),
              0);
    const pid_t listener = start({"timeout", "60", "rostopic", "echo", "-n", "1", topic});
    EXPECT_TRUE(eventually([&] { return angle.getNumSubscribers() == 2; }));
    angle.publish(smartmill_msgs::SpindleAngle());
    int status = 0;
    ::waitpid(listener, &status, 0);
    EXPECT_EQ(status, 0);
    EXPECT_TRUE(eventually([&] { return received == 2; }));
    spinner.stop();
  }
  {
    // The server of this process ends before its answer, as at a shutdown.
    const ros::Publisher angle = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 10);
    std::atomic<bool> called{false}, released{false}, answered{false};
    ros::XMLRPCManager& server = *ros::XMLRPCManager::instance();
    server.unbind("getPublications");
    server.bind("getPublications", [&](XmlRpc::XmlRpcValue&, XmlRpc::XmlRpcValue&) {
      called = true;
      eventually([&] { return released.load(); });
      answered = true;
    });
    {
      const MasterWatch watch(nh);
      ros::WallDuration(3.0).sleep();  // known to the master
      end(running, SIGKILL);
      running = start(master);
      EXPECT_TRUE(eventually([&] { return called.load(); }));
    }
    EXPECT_FALSE(answered);
    released = true;
  }
  ros::shutdown();
  end(running, SIGTERM);
}

}  // namespace
}  // namespace smartmill
