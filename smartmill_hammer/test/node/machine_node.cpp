// The closed-form machine as a ROS node that replaces the CNC bridge and the sensor driver in tests. Its time
// passes faster than that of the wall (/clock).

#include <algorithm>
#include <optional>
#include <sstream>
#include <string>

#include <actionlib/server/simple_action_server.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Clock.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/JogAction.h>
#include <smartmill_msgs/OrientSpindleAction.h>
#include <smartmill_msgs/RunProgramAction.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>
#include <smartmill_msgs/Strike.h>

#include "../closed_form_machine.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::hammer {
namespace {

constexpr double PACE = 5.0;  // [1] over real time

/// Incremental G0 and G1 blocks from a position.
std::vector<Waypoint> parse(const std::string& program, Axes3 at) {
  std::vector<Waypoint> path;
  std::istringstream lines(program);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string code;
    words >> code;
    if (code != "G0" && code != "G1") continue;
    double feed = 0.0;
    for (std::string word; words >> word;) {
      const double value = std::stod(word.substr(1));
      if (word[0] == 'F') {
        feed = value * units::MM / 60.0;
      } else {
        at[static_cast<std::size_t>(word[0] - 'X')] += value * units::MM;
      }
    }
    path.push_back({at, feed});
  }
  return path;
}

/// One action of the bridge: succeeds when the machine is at rest.
template <class Action, class Result>
class Motion {
 public:
  using Goal = typename actionlib::SimpleActionServer<Action>::GoalConstPtr;
  Motion(ros::NodeHandle nh, const std::string& name, ClosedFormMachine& machine,
         std::function<Command(const Goal&)> command)
      : machine_(machine), command_(std::move(command)), server_(nh, name, false) {
    server_.registerGoalCallback([this] {
      machine_.obey(command_(server_.acceptNewGoal()));
      accepted_ = machine_.time;
    });
    server_.registerPreemptCallback([this] {
      Command stop;
      stop.kind = Command::Kind::stop;
      machine_.obey(stop);
      Result result;
      result.code = smartmill_msgs::RunProgramResult::CANCELLED;
      result.message = "cancelled";
      server_.setPreempted(result, result.message);
    });
    server_.start();
  }
  void update() {
    if (server_.isActive() && machine_.still() && machine_.time > accepted_ + 0.1)
      server_.setSucceeded(Result());
  }

 private:
  ClosedFormMachine& machine_;
  std::function<Command(const Goal&)> command_;
  actionlib::SimpleActionServer<Action> server_;
  double accepted_ = 0.0;
};

void run() {
  ros::NodeHandle nh;
  ClosedFormMachine machine(42);
  auto clock = nh.advertise<rosgraph_msgs::Clock>("/clock", 0);
  auto blocks = nh.advertise<smartmill_msgs::SampleBlock>(names::HAMMER, 0);
  auto angles = nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, 0);
  auto states = nh.advertise<smartmill_msgs::CncState>(names::CNC_STATE, 0);
  Motion<smartmill_msgs::JogAction, smartmill_msgs::JogResult> jog(
      nh, names::JOG, machine, [](const smartmill_msgs::JogGoalConstPtr& goal) {
        Command c;
        c.kind = Command::Kind::jog;
        c.axis = goal->axis;
        c.distance = goal->distance;
        c.feed = goal->feed;
        return c;
      });
  Motion<smartmill_msgs::OrientSpindleAction, smartmill_msgs::OrientSpindleResult> orient(
      nh, names::ORIENT_SPINDLE, machine, [](const smartmill_msgs::OrientSpindleGoalConstPtr& goal) {
        Command c;
        c.kind = Command::Kind::orient;
        c.angle = goal->angle;
        return c;
      });
  Motion<smartmill_msgs::RunProgramAction, smartmill_msgs::RunProgramResult> program(
      nh, names::RUN_PROGRAM, machine, [&machine](const smartmill_msgs::RunProgramGoalConstPtr& goal) {
        Command c;
        c.kind = Command::Kind::move;
        c.path = parse(goal->program, machine.position);
        return c;
      });
  boost::function<bool(smartmill_msgs::Strike::Request&, smartmill_msgs::Strike::Response&)> strike =
      [&](smartmill_msgs::Strike::Request& request, smartmill_msgs::Strike::Response& response) {
        Command c;
        c.kind = Command::Kind::strike;
        c.direction = request.direction;
        machine.obey(c);
        response.code = smartmill_msgs::Strike::Response::OK;
        return true;
      };
  const auto service = nh.advertiseService(names::STRIKE, strike);
  bool every_other = false;
  ros::SteadyTime last = ros::SteadyTime::now();
  double due = machine.time;
  const auto timer = nh.createWallTimer(ros::WallDuration(0.005), [&](const ros::WallTimerEvent&) {
    const ros::SteadyTime now = ros::SteadyTime::now();
    due += PACE * std::min((now - last).toSec(), 0.02);  // a busy computer makes it slower
    last = now;
    while (machine.time < due) {
      SampleBlock block;
      SpindleAngle angle;
      CncState state;
      machine.block(block, angle, state);
      rosgraph_msgs::Clock time;
      time.clock = ros::Time(machine.time);
      clock.publish(time);
      blocks.publish(toMsg(block));
      angles.publish(toMsg(angle));
      if ((every_other = !every_other)) states.publish(toMsg(state));
    }
    jog.update();
    orient.update();
    program.update();
  });
  ros::spin();
}

}  // namespace
}  // namespace smartmill::hammer

int main(int argc, char** argv) {
  ros::init(argc, argv, "machine");
  smartmill::hammer::run();
  return 0;
}
