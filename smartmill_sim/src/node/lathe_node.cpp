#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <optional>
#include <thread>

#include <ros/ros.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/CuttingCondition.h>
#include <smartmill_msgs/ForceBlock.h>
#include <smartmill_msgs/LoadSample.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "node/clock.h"
#include "node/lathe_parameters.h"
#include "node/pacer.h"
#include "smartmill_core/frames.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"
#include "smartmill_ros/node_main.h"
#include "smartmill_ros/node_shell.h"
#include "smartmill_ros/parameter_server.h"
#include "smartmill_ros/run_node.h"
#include "smartmill_ros/steady_time.h"
#include "smartmill_sim/turning/lathe.h"
#include "smartmill_sim/turning/turning_machine.h"

namespace smartmill::sim {

/// The simulated lathe on ROS: probes on daq/displacement, an accelerometer on daq/vibration, the spindle on
/// spindle/angle; the fast tool servo follows control/command. With motor_currents it is a turning centre
/// that does passes: motor currents on daq/motor_current, the controller on cnc/state, cnc/load and
/// cut/condition, the true force on sim/truth/force. Runs in wall-clock time, or as the clock of the graph
/// with /use_sim_time.
class LatheNode {
 public:
  using Parameters = LatheParameters;
  /// @throws Error on bad parameters or a bad model file.
  LatheNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh)
      : parameters_(parametersFromServer(private_nh).readAll<LatheParameters>()),
        size_(
            static_cast<std::size_t>(std::max(1.0, std::round(parameters_.block * parameters_.lathe.rate)))),
        lathe_(parameters_.lathe),
        displacement_(nh.advertise<smartmill_msgs::SampleBlock>(names::DISPLACEMENT, STREAM_QUEUE)),
        vibration_(nh.advertise<smartmill_msgs::SampleBlock>(names::daq("vibration"), STREAM_QUEUE)),
        angle_(nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, STREAM_QUEUE)),
        clock_(nh),
        shell_(nh, private_nh, "simulated lathe", 1.0),
        pacer_(steadyTime(), static_cast<double>(size_) / parameters_.lathe.rate, static_cast<bool>(clock_),
               parameters_.pace) {
    if (parameters_.turning.motor.currents) becomeTurningCentre(nh);
    shell_.inputs().on<smartmill_msgs::SampleBlock>(names::CONTROL_COMMAND,
                                                    [this](const smartmill_msgs::SampleBlock& block, double) {
                                                      const std::lock_guard<std::mutex> lock(mutex_);
                                                      lathe_.command(fromMsg(block));
                                                    });
    shell_.diagnose("simulated lathe", [this](auto& status) { diagnose(status); });
    thread_ = std::thread([this] { run(); });
  }
  ~LatheNode() {
    stopping_ = true;
    thread_.join();
  }
  LatheNode(const LatheNode&) = delete;
  LatheNode& operator=(const LatheNode&) = delete;

 private:
  void becomeTurningCentre(ros::NodeHandle& nh) {
    const MachineModel model = readMachineModel(parameters_.model);
    machine_.emplace(lathe_, parameters_.turning, parameters_.lathe, model.needSpindle("simulate the lathe"));
    motor_current_ = nh.advertise<smartmill_msgs::SampleBlock>(names::MOTOR_CURRENT, STREAM_QUEUE);
    force_ = nh.advertise<smartmill_msgs::ForceBlock>(names::TRUE_FORCE, STREAM_QUEUE);
    state_ = nh.advertise<smartmill_msgs::CncState>(names::CNC_STATE, STREAM_QUEUE);
    load_ = nh.advertise<smartmill_msgs::LoadSample>(names::CNC_LOAD, STREAM_QUEUE);
    condition_ = nh.advertise<smartmill_msgs::CuttingCondition>(names::CUTTING_CONDITION, 1, true);
  }

  void run() {
    while (!stopping_) {
      const double wait = pacer_.wait(steadyTime());
      if (wait > 0.0) std::this_thread::sleep_for(std::chrono::duration<double>(wait));
      TurningMachine::Block block;
      {
        std::unique_lock<std::mutex> lock(mutex_);
        if (parameters_.await_commands && !lathe_.hasCommands(size_)) {
          lock.unlock();
          std::this_thread::sleep_for(std::chrono::duration<double>(parameters_.poll_period));
          continue;
        }
        if (machine_) {
          block = machine_->advance(size_);
        } else {
          block.sensors = lathe_.advance(size_);
        }
        late_ = lathe_.late();
      }
      publish(block.sensors);
      if (machine_) publish(block);
      pacer_.proceed();
      clock_.publish(pacer_.now());
    }
  }

  /// The same with stamps of the clock.
  template <class Part>
  Part shifted(Part part) const {
    part.stamp += pacer_.start();
    return part;
  }

  void publish(const Lathe::Block& block) {
    angle_.publish(toMsg(shifted(block.angle)));
    displacement_.publish(toMsg(shifted(block.displacement)));
    vibration_.publish(toMsg(shifted(block.vibration)));
    double sum = 0.0, squares = 0.0;
    for (const double m : block.motion) sum += m, squares += m * m;
    const double n = static_cast<double>(block.motion.size());
    motion_ = std::sqrt(std::max(0.0, squares / n - sum * sum / n / n));
  }

  void publish(const TurningMachine::Block& block) {
    if (block.condition) condition_.publish(toMsg(shifted(*block.condition)));
    motor_current_.publish(toMsg(shifted(block.motor_current)));
    force_.publish(toMsg(shifted(block.force), frames::MACHINE));
    if (block.state.stamp < next_state_ - 0.5 * parameters_.block) return;
    next_state_ = block.state.stamp + parameters_.state_period;
    state_.publish(toMsg(shifted(block.state)));
    load_.publish(toMsg(shifted(block.load)));
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "running");
    status.addf("clock held back [s]", "%.3f", pacer_.heldBack());
    status.addf("late commands [1]", "%llu", static_cast<unsigned long long>(late_.load()));
    status.addf("relative motion of tool and work, standard deviation over a block [m]", "%.3g",
                motion_.load());
  }

  LatheParameters parameters_;
  std::size_t size_;  // samples of a block
  Lathe lathe_;
  std::optional<TurningMachine> machine_;
  std::mutex mutex_;  // of the lathe
  ros::Publisher displacement_, vibration_, angle_, motor_current_, force_, state_, load_, condition_;
  Clock clock_;
  NodeShell shell_;
  Pacer pacer_;
  double next_state_ = 0.0;  // [s] since the start
  std::atomic<std::uint64_t> late_{0};
  std::atomic<double> motion_{0.0};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace smartmill::sim

int smartmill::nodeMain(int argc, char** argv) {
  return runNode<sim::LatheNode>(argc, argv, "lathe");
}
