#pragma once

#include <memory>
#include <string>

#include <ros/node_handle.h>

#include "smartmill_kalman/compensation/compensation_pipeline.h"

namespace smartmill::kalman {

/// The action kalman/calibrate: each goal is a step of a calibration, started at its stamp in the streams.
/// The result of a fit is written to the goal's file. Runs in the thread of the callbacks.
class CalibrationServer {
 public:
  /// @param live false: replay; no file is written, goals wait for their stamps
  CalibrationServer(ros::NodeHandle nh, CompensationPipeline& pipeline, bool live);
  ~CalibrationServer();

  void finish(const CalibrationResult& result);
  /// Ends a running goal; no more sensor data are expected.
  void abort(const std::string& reason);
  /// Time jumped back: ends a running goal.
  void restart();
  const std::string& lastMessage() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace smartmill::kalman
