// rosrun smartmill_launch discover: sends a goal to the action `discover` of the running machine and prints
// its result.

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <actionlib/client/simple_action_client.h>
#include <ros/ros.h>
#include <smartmill_msgs/ArmMotion.h>
#include <smartmill_msgs/DiscoverAction.h>
#include <nlohmann/json.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_core/program.h"
#include "smartmill_core/stop_signal.h"

namespace {

using namespace smartmill;
using Goal = smartmill_msgs::DiscoverGoal;
using Result = smartmill_msgs::DiscoverResult;
using Feedback = smartmill_msgs::DiscoverFeedback;
using Json = nlohmann::ordered_json;

constexpr double CANCEL_WAIT = 30.0;  // [s] until the machine is safe

struct Request {
  std::string out;
  bool arm = false, install = true;
  int tests = 3;
  double timeout = 900.0, ready = 60.0;
};

void arm(bool on) {
  smartmill_msgs::ArmMotion service;
  service.request.arm = on;
  const std::string name = names::absolute(names::ARM_MOTION);
  if (!ros::service::waitForService(name, ros::Duration(30.0)) || !ros::service::call(name, service))
    throw Error(name + ": no answer");
  if (service.response.code != 0) throw Error(name + ": " + service.response.message);
}

Json number(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);  // JSON has no NaN
}

void write(const Result& r, const std::string& file) {
  const Json json{{"code", r.code},
                  {"message", r.message},
                  {"verdict", r.verdict},
                  {"effects", r.effects},
                  {"tests", r.tests},
                  {"gap_before", number(r.gap_before)},
                  {"gap_after", number(r.gap_after)},
                  {"report", r.report},
                  {"model", r.model}};
  std::error_code ignored;  // the stream reports the failure
  std::filesystem::create_directories(std::filesystem::absolute(file).parent_path(), ignored);
  std::ofstream out(file);
  out << json.dump(2) << "\n";
  out.close();
  if (!out) throw Error(file + ": cannot be written");
}

class DiscoverClient {
 public:
  explicit DiscoverClient(const Request& request)
      : request_(request), client_(names::absolute(names::DISCOVER), true), begin_(ros::SteadyTime::now()) {
    if (!client_.waitForServer(ros::Duration(request.ready)))
      throw Error("action " + names::absolute(names::DISCOVER) + ": no node offers it");
  }

  // The controller may still be starting.
  void armWhenConnected() const {
    const ros::SteadyTime end = ros::SteadyTime::now() + ros::WallDuration(request_.ready);
    for (;;) {
      try {
        arm(true);
        return;
      } catch (const Error&) {
        if (stopRequested() || ros::SteadyTime::now() > end) throw;
        ros::WallDuration(0.5).sleep();
      }
    }
  }

  Result result() {
    Goal goal;
    goal.header.stamp = ros::Time::now();
    goal.most_tests = static_cast<std::uint32_t>(request_.tests);
    goal.install = request_.install;
    client_.sendGoal(goal, {}, {}, [this](const smartmill_msgs::DiscoverFeedbackConstPtr& f) { print(*f); });
    bool ended = false;
    while (!ended && !stopRequested() && (ros::SteadyTime::now() - begin_).toSec() < request_.timeout)
      ended = client_.waitForResult(ros::Duration(0.1));
    if (!ended) {
      client_.cancelGoal();
      ended = client_.waitForResult(ros::Duration(CANCEL_WAIT));
    }
    if (!ended || !client_.getResult()) throw Error("discover: no result");
    return *client_.getResult();
  }

 private:
  void print(const Feedback& f) const {
    std::printf("discover [%6.1f s] %s\n", (ros::SteadyTime::now() - begin_).toSec(), f.stage.c_str());
    std::fflush(stdout);
  }

  Request request_;
  actionlib::SimpleActionClient<smartmill_msgs::DiscoverAction> client_;
  ros::SteadyTime begin_;
};

// @return exit status
int run(const Request& request) {
  DiscoverClient client(request);
  if (request.arm) client.armWhenConnected();
  const Result result = client.result();
  if (request.arm && result.code == Result::OK) arm(false);
  std::printf("discover: %s\n", result.message.c_str());
  for (const std::string& test : result.tests) std::printf("discover: suggested test: %s\n", test.c_str());
  std::fflush(stdout);
  if (!request.out.empty()) write(result, request.out);
  return stopRequested() ? INTERRUPTED : result.code == Result::OK ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "discover_client", ros::init_options::NoSigintHandler);
  smartmill::catchStopSignals();
  Request request;
  smartmill::CommandLine line{
      "Makes the running machine identify why it differs from its model (action discover)."};
  line.option("-o,--out", request.out, "JSON file for the result");
  line.option("--tests", request.tests, "maximum number of suggested tests").within(0, 100);
  line.option("--timeout", request.timeout, "[s] time limit").positive();
  line.flag("--arm", request.arm,
            "arm motion before and disarm it afterwards; without it the operator does both");
  line.flag("!--no-install", request.install, "do not install the improved model");
  // Without the arguments that roslaunch adds (__name:=).
  std::vector<std::string> words;
  ros::removeROSArgs(argc, argv, words);
  std::vector<const char*> arguments;
  for (const std::string& word : words) arguments.push_back(word.c_str());
  return smartmill::runProgram(line, static_cast<int>(arguments.size()), arguments.data(), [&] {
    const ros::NodeHandle keep_ros_running;
    return run(request);
  });
}
