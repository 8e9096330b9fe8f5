#pragma once

#include <actionlib/server/action_server.h>
#include <ros/ros.h>

#include <cstdint>
#include <map>
#include <memory>

#include "node/axis_drive_server.h"
#include "node/fleet_pusher.h"
#include "node/parameters.h"
#include "node/wiring.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_loadmeter/database/database_location.h"
#include "smartmill_loadmeter/database/waiting_records.h"
#include "smartmill_loadmeter/identification/identification_pipeline.h"
#include "smartmill_msgs/CoefficientPrior.h"
#include "smartmill_msgs/DiscoverActionResult.h"
#include "smartmill_msgs/FindCoefficients.h"
#include "smartmill_msgs/IdentifyCoefficientsAction.h"
#include "smartmill_msgs/RecommendCut.h"
#include "smartmill_msgs/SpindleHealth.h"
#include "smartmill_ros/latched_topic.h"
#include "smartmill_ros/node_shell.h"

namespace smartmill::loadmeter {

/// ROS interface of IdentificationPipeline and ForceCurvePipeline.
class LoadMeterNode {
 public:
  using Parameters = NodeParameters;
  /// @throws Error for an invalid parameter, model or database.
  LoadMeterNode(ros::NodeHandle nh, ros::NodeHandle private_nh);
  ~LoadMeterNode();
  LoadMeterNode(const LoadMeterNode&) = delete;
  LoadMeterNode& operator=(const LoadMeterNode&) = delete;

 private:
  using Server = actionlib::ActionServer<smartmill_msgs::IdentifyCoefficientsAction>;

  void goal(Server::GoalHandle handle);
  void cancel(Server::GoalHandle handle);
  void finish(const IdentifyResult& result);
  void feedback();
  bool find(smartmill_msgs::FindCoefficients::Request& request,
            smartmill_msgs::FindCoefficients::Response& response);
  bool recommend(smartmill_msgs::RecommendCut::Request& request,
                 smartmill_msgs::RecommendCut::Response& response);
  bool keep(const char* what, WaitingRecords::Store store);
  void retryStoring();
  void store(CoefficientRecord cut);
  void store(const smartmill_msgs::DiscoverActionResult& discovered);
  void store(const smartmill_msgs::SpindleHealth& health);
  void store(InspectionResult inspected);
  void publish(const MotorForce& force);
  void publish(const ForceEstimate& force);
  void report(const ForceEstimate& force);
  void publish(const IdentifiedForceCurves& found);
  void watch();
  void publishFleetState();
  void reportDatabase(const ros::NodeHandle& private_nh) const;
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeParameters parameters_;
  NodeShell shell_;
  MachineModel model_;
  IdentificationPipeline identification_;
  ForceCurvePipeline curves_;
  CutStreams streams_{identification_, curves_, parameters_};
  OpenedDatabase opened_;
  CoefficientDatabase& database_;
  WaitingRecords records_;
  std::unique_ptr<FleetPusher> pusher_;
  std::map<std::uint64_t, Server::GoalHandle> waiting_;
  std::uint64_t next_id_ = 1;
  PriorKnowledge prior_;  // of the next goals
  std::string last_message_, last_force_, last_curve_, last_inspection_, refused_inspection_;
  std::size_t stored_cuts_ = 0, stored_explanations_ = 0, stored_health_ = 0, stored_inspections_ = 0;
  std::uint64_t published_fleet_state_ = 0;

  std::unique_ptr<LatchedTopic<smartmill_msgs::CuttingCoefficients>> coefficients_;
  ros::Publisher force_publisher_, estimate_publisher_, curve_publisher_, fleet_publisher_;
  ros::Subscriber discovered_, health_, prior_subscriber_;
  ros::ServiceServer find_service_, recommend_service_;
  Server server_;
  AxisDriveServer axis_drives_;
};

}  // namespace smartmill::loadmeter
