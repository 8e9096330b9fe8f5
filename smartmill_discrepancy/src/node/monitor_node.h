#pragma once

#include <map>
#include <string>
#include <vector>

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/ros.h>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_discrepancy/live/live_gap.h"
#include "smartmill_discrepancy/live/stretch_recorder.h"

namespace smartmill::discrepancy {

/// Keys of launch/config/monitor.yaml.
struct MonitorParameters {
  std::string model;           ///< path of a smartmill-model/1 file
  StretchParameters stretch;   ///< length, settle, path_tolerance
  double hold_back = 0.05;     ///< [s] that an event may be late
  LiveGapOptions gap;          ///< limit, load_step
  std::string record_folder;   ///< stretches that do not fit are kept here as a campaign; empty: not kept
  int most_recorded = 40;      ///< [1] stretches
  int most_per_condition = 2;  ///< [1] stretches
  double record_after = 0.4;   ///< [s] that a cut has run before a stretch is kept
  void validate() const;       ///< @throws Error naming key and value
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
  void record(const Stretch& stretch);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  MonitorParameters parameters_;
  MachineModel model_;
  SortedStretches stretches_;
  LiveGap last_;
  std::string problem_;  // why the last stretch could not be judged
  int recorded_ = 0;
  std::map<std::string, int> recorded_of_;  // by condition
  ros::Publisher state_;
  std::vector<ros::Subscriber> subscribers_;
  diagnostic_updater::Updater diagnostics_;
  ros::WallTimer timer_;
};

}  // namespace smartmill::discrepancy
