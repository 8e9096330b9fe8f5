#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <thread>

#include <ros/ros.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "node/lathe_parameters.h"
#include "smartmill_core/error.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/node_shell.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"
#include "smartmill_sim/turning/lathe.h"

namespace smartmill::sim {

/// The simulated lathe on ROS: probes on daq/displacement, an accelerometer on daq/vibration, the spindle on
/// spindle/angle; the fast tool servo follows control/command. Runs in wall-clock time.
class LatheNode {
 public:
  using Parameters = LatheParameters;
  /// @throws Error on bad parameters.
  LatheNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
      : parameters_(parametersFromServer(private_nh).readAll<LatheParameters>()),
        lathe_(parameters_.lathe),
        displacement_(nh.advertise<smartmill_msgs::SampleBlock>(names::DISPLACEMENT, STREAM_QUEUE)),
        vibration_(nh.advertise<smartmill_msgs::SampleBlock>(names::daq("vibration"), STREAM_QUEUE)),
        angle_(nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, STREAM_QUEUE)),
        shell_(nh, private_nh, "simulated lathe", 1.0) {
    if (ros::Time::isSimTime())
      throw Error("/use_sim_time is set: the simulated machine runs in wall-clock time");
    shell_.inputs().on<smartmill_msgs::SampleBlock>(names::CONTROL_COMMAND,
                                                    [this](const smartmill_msgs::SampleBlock& block, double) {
                                                      const std::lock_guard<std::mutex> lock(mutex_);
                                                      lathe_.command(fromMsg(block));
                                                    });
    shell_.diagnose("simulated lathe", [this](auto& status) { diagnose(status); });
    start_ = toSec(ros::Time::now());
    thread_ = std::thread([this] { run(); });
  }
  ~LatheNode() {
    stopping_ = true;
    thread_.join();
  }
  LatheNode(const LatheNode&) = delete;
  LatheNode& operator=(const LatheNode&) = delete;

 private:
  void run() {
    const auto size =
        static_cast<std::size_t>(std::max(1.0, std::round(parameters_.block * parameters_.lathe.rate)));
    const double span = static_cast<double>(size) / parameters_.lathe.rate;
    double done = 0.0;  // [s]
    while (!stopping_) {
      const double ahead = done + span - (toSec(ros::Time::now()) - start_);
      if (ahead > 0.0) std::this_thread::sleep_for(std::chrono::duration<double>(ahead));
      Lathe::Block block;
      {
        std::unique_lock<std::mutex> lock(mutex_);
        if (parameters_.await_commands && !lathe_.hasCommands(size)) {
          lock.unlock();
          std::this_thread::sleep_for(std::chrono::duration<double>(parameters_.poll_period));
          continue;
        }
        block = lathe_.advance(size);
        late_ = lathe_.late();
      }
      const auto shifted = [this](auto part) {
        part.stamp += start_;
        return part;
      };
      angle_.publish(toMsg(shifted(block.angle)));
      displacement_.publish(toMsg(shifted(block.displacement)));
      vibration_.publish(toMsg(shifted(block.vibration)));
      double sum = 0.0, squares = 0.0;
      for (const double m : block.motion) sum += m, squares += m * m;
      const double n = static_cast<double>(block.motion.size());
      motion_ = std::sqrt(std::max(0.0, squares / n - sum * sum / n / n));
      done += span;
    }
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    status.addf("late commands [1]", "%llu", static_cast<unsigned long long>(late_.load()));
    status.addf("relative motion of tool and work, standard deviation over a block [m]", "%.3g",
                motion_.load());
  }

  LatheParameters parameters_;
  Lathe lathe_;
  std::mutex mutex_;  // of the lathe
  double start_ = 0.0;
  ros::Publisher displacement_, vibration_, angle_;
  NodeShell shell_;
  std::atomic<std::uint64_t> late_{0};
  std::atomic<double> motion_{0.0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace smartmill::sim

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<sim::LatheNode>(argc, argv, "lathe");
}
