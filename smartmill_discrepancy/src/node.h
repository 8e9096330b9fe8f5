#pragma once

#include <string>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/live_gap.h"
#include "smartmill_discrepancy/stretch_recorder.h"

namespace smartmill::discrepancy {

/// Keys of launch/config/monitor.yaml.
struct MonitorParameters {
  std::string model;             ///< path of a smartmill-model/1 file
  double length = 0.3;           ///< [s] of a stretch, > 0.1
  double path_tolerance = 1e-4;  ///< [m] beside the condition's line
  double hold_back = 0.05;       ///< [s] that an event may be late
  double limit = 1.5;            ///< [1] gap above which the model does not fit
  std::string record_folder;     ///< stretches that do not fit are kept here as a campaign; empty: not kept
  int most_recorded = 40;        ///< stretches
  void validate() const;         ///< @throws Error naming key and value
};

/// Shell around SortedStretches and liveGap(): the twin follows the running machine, discrepancy/state out.
class MonitorNode {
 public:
  /// @throws Error on a wrong parameter or model.
  MonitorNode(ros::NodeHandle nh, ros::NodeHandle private_nh);

 private:
  template <typename Message>
  void subscribe(ros::NodeHandle& nh, const char* topic);
  void judge(const Stretch& stretch);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  MonitorParameters parameters_;
  MachineModel model_;
  SortedStretches stretches_;
  LiveGap last_;
  std::string problem_;  // why the last stretch could not be judged
  int recorded_ = 0;
  ros::Publisher state_;
  std::vector<ros::Subscriber> subscribers_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer timer_;
};

}  // namespace smartmill::discrepancy
