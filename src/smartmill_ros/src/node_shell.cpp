#include "smartmill_ros/node_shell.h"

#include <exception>
#include <utility>

#include <ros/console.h>

namespace smartmill {
namespace {

constexpr double TICK = 0.05;  // [s]

}  // namespace

NodeShell::NodeShell(ros::NodeHandle nh, ros::NodeHandle private_nh, const std::string& hardware,
                     double input_timeout)
    : nh_(nh), inputs_(nh, input_timeout), diagnostics_(nh, std::move(private_nh)) {
  diagnostics_.setHardwareID(hardware);
  diagnostics_.add("inputs", &inputs_, &Inputs::diagnose);
  every(TICK, [this] {
    inputs_.tick(TICK);
    diagnostics_.update();  // publishes once a second
  });
}

void NodeShell::diagnose(const std::string& name,
                         std::function<void(diagnostic_updater::DiagnosticStatusWrapper&)> task) {
  diagnostics_.add(name, std::move(task));
}

void NodeShell::every(double period, std::function<void()> work) {
  timers_.push_back(
      nh_.createWallTimer(ros::WallDuration(period), [work = std::move(work)](const ros::WallTimerEvent&) {
        try {
          work();
        } catch (const std::exception& error) {
          ROS_ERROR_STREAM_THROTTLE(5.0, error.what());
        }
      }));
}

}  // namespace smartmill
