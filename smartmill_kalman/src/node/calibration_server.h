#pragma once

#include <memory>
#include <string>

#include <ros/node_handle.h>

#include "smartmill_kalman/compensation/compensation_pipeline.h"

namespace smartmill::kalman {

/// The action kalman/calibrate: a step of a calibration a goal, each begun at its turn among the streams;
/// what a fit found is written where the goal says. All in the thread of the callbacks.
class CalibrationServer {
 public:
  CalibrationServer(ros::NodeHandle nh, CompensationPipeline& sorted);
  ~CalibrationServer();

  void finish(const CalibrationResult& result);
  /// The sensor is silent: nothing that runs or waits can come to an end.
  void lost(const std::string& why);
  /// Time went back: nothing that was asked for is of this run.
  void restart();
  const std::string& lastMessage() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::kalman
