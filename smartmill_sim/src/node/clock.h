#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <rosgraph_msgs/Clock.h>

#include "smartmill_ros/inputs.h"

namespace smartmill::sim {

/// Topic /clock, if /use_sim_time is set.
class Clock {
 public:
  explicit Clock(ros::NodeHandle& nh) {
    if (ros::Time::isSimTime()) publisher_ = nh.advertise<rosgraph_msgs::Clock>("/clock", STREAM_QUEUE);
  }
  explicit operator bool() const { return static_cast<bool>(publisher_); }

  /// @param stamp [s]
  void publish(double stamp) const {
    if (!publisher_) return;
    rosgraph_msgs::Clock clock;
    clock.clock.fromSec(stamp);
    publisher_.publish(clock);
  }

 private:
  ros::Publisher publisher_;
};

}  // namespace smartmill::sim
