#include "node/servo_publisher.h"

#include <cmath>

#include <smartmill_msgs/LoadSample.h>
#include <smartmill_msgs/SampleBlock.h>
#include <smartmill_msgs/SpindleAngle.h>

#include "smartmill_core/math/angle.h"
#include "smartmill_core/names.h"
#include "smartmill_ros/conversions.h"

namespace smartmill::cnc {
namespace {

constexpr const char* SERVO_TOPIC = "cnc/servo";
constexpr double WAIT = 0.02;    // [s] for the next block
constexpr double PERIOD = 1e-3;  // [s] of the servo thread

}  // namespace

double rosSeconds() {
  return ros::Time::now().toSec();
}

ServoPublisher::ServoPublisher(ros::NodeHandle nh, NodeShell& shell,
                               std::shared_ptr<linuxcnc::ServoStream> stream, const std::string& load_input)
    : stream_(std::move(stream)),
      servo_(nh.advertise<smartmill_msgs::SampleBlock>(SERVO_TOPIC, STREAM_QUEUE)),
      angle_(nh.advertise<smartmill_msgs::SpindleAngle>(names::SPINDLE_ANGLE, STREAM_QUEUE)) {
  if (!load_input.empty()) {
    shell.inputs().on<smartmill_msgs::LoadSample>(load_input, [this](const auto& load, double) {
      if (std::isfinite(load.spindle_load)) {
        stream_->setLoad(load.header.stamp.toSec(), load.spindle_load);
      }
    });
  }
  shell.diagnose("servo stream", [this](auto& status) { diagnose(status); });
  thread_ = std::thread([this] { run(); });
}

ServoPublisher::~ServoPublisher() {
  stopping_ = true;
  thread_.join();
}

void ServoPublisher::run() {
  while (!stopping_) {
    const double before = rosSeconds();
    for (const linuxcnc::ServoSegment& segment : stream_->step(WAIT, rosSeconds)) {
      publish(segment);
    }
    // Without a connection step() does not wait.
    if (rosSeconds() - before < PERIOD) {
      std::this_thread::sleep_for(std::chrono::duration<double>(PERIOD));
    }
  }
}

void ServoPublisher::publish(const linuxcnc::ServoSegment& segment) {
  SampleBlock block;
  block.stamp = segment.stamp;
  block.sample_rate = 1.0 / PERIOD;
  block.first_index = segment.first;
  block.channels = {
      "x",      "y",   "z", "revolutions", "spindle_speed", "velocity", "distance_to_go", "spindle_load",
      "marker", "tool"};
  block.units = {"m", "m", "m", "1", "rad/s", "m/s", "m", "1", "1", "1"};
  SpindleAngle angle;
  for (const linuxcnc::ServoSample& s : segment.samples) {
    block.samples.insert(block.samples.end(),
                         {s.position[0], s.position[1], s.position[2], s.revolutions, s.spindle_speed,
                          s.velocity, s.distance_to_go, s.spindle_load, s.marker, s.tool});
    const auto index = static_cast<double>(block.size() - 1);
    angle.stamp = segment.stamp + index * PERIOD;
    angle.angle = wrapped(units::TWO_PI * (s.revolutions - std::floor(s.revolutions)));
    angle.speed = std::abs(s.spindle_speed);
    angle_.publish(toMsg(angle));
  }
  servo_.publish(toMsg(block));
}

void ServoPublisher::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) {
  using Level = diagnostic_msgs::DiagnosticStatus;
  const linuxcnc::ServoStatistics statistics = stream_->statistics();
  const std::uint64_t before = std::exchange(reported_samples_, statistics.samples);
  const std::uint64_t late_loads =
      statistics.without_load - std::exchange(reported_without_load_, statistics.without_load);
  if (before == statistics.samples) {
    status.summary(Level::ERROR, "silent");
  } else if (statistics.lost > 0) {
    status.summary(Level::WARN, "samples were lost");
  } else if (late_loads > 0) {
    status.summary(Level::WARN, "the load meter is late: load not known");
  } else {
    status.summary(Level::OK, "all servo cycles received");
  }
  status.add("samples [1]", std::to_string(statistics.samples));
  status.add("lost [1]", std::to_string(statistics.lost));
  status.add("samples without load [1]", std::to_string(statistics.without_load));
  status.add("restarts of the controller [1]", std::to_string(statistics.restarts));
  status.addf("late, median [ms]", "%.1f", 1e3 * statistics.late_median);
  status.addf("late, 99 % [ms]", "%.1f", 1e3 * statistics.late_99);
  status.addf("late, worst [ms]", "%.1f", 1e3 * statistics.late_worst);
}

}  // namespace smartmill::cnc
