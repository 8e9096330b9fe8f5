#pragma once

#include <cstdint>
#include <map>
#include <string>

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <smartmill_msgs/InstallModel.h>

#include "node/monitor_parameters.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::discrepancy {

/// ROS shell around SegmentPipeline and liveGap(): publishes discrepancy/state and discrepancy/force.
class MonitorNode {
 public:
  using Parameters = MonitorParameters;
  /// @throws Error on an invalid parameter or model.
  MonitorNode(ros::NodeHandle nh, const ros::NodeHandle& private_nh);

 private:
  void evaluate(const RecordSegment& segment);
  void publishForce(const RecordSegment& segment);
  void record(const RecordSegment& segment);
  bool install(smartmill_msgs::InstallModel::Request& request,
               smartmill_msgs::InstallModel::Response& response);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  MonitorParameters parameters_;
  MachineModel model_;
  NodeShell shell_;
  SegmentPipeline segments_;
  LiveGap last_;
  std::string problem_;  // why the last segment could not be evaluated
  int recorded_ = 0;
  std::map<std::string, int> recorded_of_;  // by condition
  std::uint64_t simulated_ = 0;             // samples of the twin published
  ros::Publisher state_, force_;
  ros::ServiceServer install_;
};

}  // namespace smartmill::discrepancy
