#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <ros/ros.h>

#include "session_summary.h"

namespace smartmill::session {

/// The steps of a session: printed, published and kept for the summary.
class SessionLog {
 public:
  SessionLog(ros::NodeHandle& nh, const std::string& tool, const std::string& material);

  /// A step has ended. @param mark "ok", "stop" or "FAIL"
  void record(const char* mark, const std::string& name, const std::string& detail);
  /// Publishes the steps so far. @param running name of the step in progress; empty: none
  void publish(const std::string& running, bool ended = false);

  /// Requests an action of the operator, as the step in progress.
  void request(const std::string& text);
  double elapsed() const { return (ros::SteadyTime::now() - begin_).toSec(); }  ///< [s]

  SessionSummary summary;

 private:
  ros::SteadyTime begin_ = ros::SteadyTime::now();
  ros::Publisher state_;
  std::vector<std::uint8_t> outcomes_;  // SessionStep.DONE, ... of the summary's steps
};

}  // namespace smartmill::session
