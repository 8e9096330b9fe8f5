#pragma once

#include <functional>

#include <ros/ros.h>

namespace smartmill::testing {

/// Handles callbacks until a condition holds. @param seconds wall time, a limit for a busy computer
/// @return whether it holds
inline bool waitFor(const std::function<bool()>& condition, double seconds) {
  const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(seconds);
  while (!condition()) {
    if (ros::WallTime::now() > end || !ros::ok()) return false;
    ros::spinOnce();
    ros::WallDuration(0.02).sleep();
  }
  return true;
}

}  // namespace smartmill::testing
