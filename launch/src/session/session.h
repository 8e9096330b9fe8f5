#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <ros/ros.h>
#include <smartmill_msgs/ChatterState.h>
#include <smartmill_msgs/CncState.h>
#include <smartmill_msgs/IdentifyAxisDriveAction.h>
#include <smartmill_msgs/IdentifyCoefficientsAction.h>
#include <smartmill_msgs/MeasureFrfAction.h>
#include <smartmill_msgs/StabilityChart.h>

#include "session/machine_driver.h"
#include "session/sensor_calibration.h"
#include "session_log.h"
#include "session_parameters.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_launch/session/session_plan.h"
#include "smartmill_launch/session/session_progress.h"
#include "smartmill_ros/kept_messages.h"

namespace smartmill::session {

/// Runs all steps of a session in order, by actions and services of the other nodes.
class Session {
 public:
  /// @param stopped polled: once true, goals are cancelled and motion is disarmed. @throws Error on an
  /// invalid parameter or a session that does not fit the machine.
  Session(ros::NodeHandle nh, const ros::NodeHandle& private_nh, std::function<bool()> stopped);
  ~Session();

  /// @return exit code of the program.
  int run();

 private:
  void runSteps();
  void step(const std::string& name, const std::function<std::string()>& work);
  /// A step that a resumed session does not repeat. @param holder node whose memory contains the result;
  /// empty: every node restores it. @param lane it cuts a lane of the stock
  void action(const std::string& name, const std::string& holder, const std::function<std::string()>& work,
              bool lane = false);
  /// Takes the result of the interrupted session. @return false: there is none
  bool doneBefore(const std::string& name);
  void keepProgress();
  std::string beginProgress();
  std::string continueProgress(const std::string& text);
  std::uint32_t startsOf(const std::string& node) const;
  void pause(double seconds) const;
  bool waitUntil(const std::function<bool()>& ready, double seconds) const;

  std::string waitReady();
  std::string arm(bool on);
  std::string measure(Client<smartmill_msgs::MeasureFrfAction>& client, const std::string& name,
                      const std::string& point, const std::string& direction, int hits, int modes);
  void calibrateSensor();
  void tuneFilter();
  void moveInAir();
  std::string runCut(const PlannedCut& cut);
  std::string useStored();
  void runTests(const std::set<std::size_t>& selected);
  void identifyFromTests();
  std::string identifyAndCompare();
  std::string chooseCuts(bool without_stored);
  std::vector<double> depthLimits(const std::vector<std::size_t>& candidates) const;
  void waitVerdict();
  void waitCurve() const;
  std::string identify(bool reset);
  std::string waitChart();
  std::string choosePoints();
  void learnFromCuts();
  void judgeSlotTests();
  std::string chooseProbingCut(std::size_t cuts_left);
  std::string probe(std::size_t index);
  CutVerdict verdictOn(const std::string& condition) const;
  std::string cutUnderControl(const PlannedCut& cut);
  std::string verify(const char* role, const PlannedCut& cut, CutVerdict::Kind predicted);
  void makeSafe();
  std::string missing();
  void requireNodes();
  std::string recorderMissing() const;

  ros::NodeHandle nh_;
  const std::function<bool()> stopped_;
  SessionParameters parameters_;
  MachineModel model_;
  SessionPlan plan_;
  SessionLog log_;
  bool armed_ = false;

  Client<smartmill_msgs::MeasureFrfAction> tool_frf_, sensor_frf_;
  Client<smartmill_msgs::IdentifyCoefficientsAction> identify_;
  Client<smartmill_msgs::IdentifyAxisDriveAction> drive_;
  MachineDriver driver_;
  SensorCalibration sensor_;
  std::vector<ros::Subscriber> subscribers_;
  ros::Subscriber chart_subscriber_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;

  mutable std::mutex mutex_;                              // guards the members that subscribers write
  std::map<std::string, ros::SteadyTime> last_received_;  // by topic
  std::optional<smartmill_msgs::StabilityChart> chart_;
  std::map<std::string, std::vector<ChatterWindow>> windows_;  // by condition
  bool under_control_ = false;    // the cut that the chatter control is to stabilise is running
  std::vector<CutState> states_;  // of the controller in it, in motion
  std::map<std::string, std::uint32_t> starts_;          // of the nodes in this launch, by full name
  std::optional<smartmill_msgs::ChatterState> verdict_;  // the latest
  ros::Time curve_stamp_;                                // end of the last cut that the force curve contains

  std::vector<PlannedCut> tests_;  // air cuts, then slots or the chosen cuts
  std::set<std::size_t> needed_;   // of these, with the stored coefficients
  std::set<std::size_t> made_;     // of these
  bool has_prior_ = false;         // the coefficients of the database are used
  ros::Publisher prior_;

  KeptTexts kept_;
  SessionProgress progress_;

  ros::Time cut_from_;
  ros::Time coefficients_stamp_;
  smartmill_msgs::StabilityChart used_chart_;
  Point stable_, unstable_;
  // Without a hammer: the next cut and its probability of being stable [1], and the feed per tooth [m].
  Point next_;
  double next_probability_ = NOT_A_NUMBER, probing_feed_ = 0.0;
};

}  // namespace smartmill::session
