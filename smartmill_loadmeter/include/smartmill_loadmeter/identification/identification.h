#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "smartmill_core/cutting/coefficient_set.h"
#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/calibration/load_meter.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/production.h"
#include "smartmill_loadmeter/motor/drive_moves.h"
#include "smartmill_loadmeter/motor/force_estimate.h"
#include "smartmill_loadmeter/motor/force_record.h"
#include "smartmill_loadmeter/motor/motor_chain.h"
#include "smartmill_loadmeter/motor/self_calibration.h"

namespace smartmill::loadmeter {

struct IdentificationParameters {
  double speed_tolerance = 0.02;
  double settle_time_constants = 8.0;
  double guard_time = 0.05;
  double path_tolerance = 1.0e-3;
  int minimum_readings = 10;
  double maximum_gap = 0.5;
  double production_memory = 1800.0;
  double largest_runout = 3.0e-5;
  MotorParameters motor;          ///< of daq/motor_current
  ForceEstimateParameters force;  ///< of the force of each cut

  /// Without the motors' and the force's, whose keys have a prefix.
  void declare(ParameterTable& table) {
    table.number("speed_tolerance", speed_tolerance, "1", Range::open(0.0, 0.5),
                 "share of the commanded spindle speed within which it counts as reached");
    table.number("settle_time_constants", settle_time_constants, "1", Range::closed(5.0, 1000.0),
                 "time constants of the load meter waited for after a change; 8 leave 0.03 % of a step");
    table.number("guard_time", guard_time, "s", Range::closed(0.0, 10.0),
                 "readings dropped before steadiness is lost (stamps are replies' times)");
    table.number("path_tolerance", path_tolerance, "m", Range::openLow(0.0, 1.0),
                 "distance from the line between steady_from and steady_to");
    table.number("minimum_readings", minimum_readings, "1", Range::atLeast(2), "steady readings of a test");
    table.number("maximum_gap", maximum_gap, "s", Range::openLow(0.0, 60.0),
                 "without controller state or load steadiness is lost");
    table.number("production_memory", production_memory, "s", Range::openLow(0.0, 1e7),
                 "of cutting after which a production cut counts 1/e in the running estimate");
    table.number("largest_runout", largest_runout, "m", Range::closed(0.0, 1e-3),
                 "offset of the cutter axis that may be; 0.0: none is looked for");
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Goal of the action IdentifyCoefficients.
struct IdentifyGoal {
  double stamp = 0.0;    ///< [s]
  std::string tool;      ///< empty: any
  std::string material;  ///< empty: any
  bool reset = false;    ///< forget earlier tests
  std::uint64_t id = 0;  ///< handed back with the result
};

struct IdentifyResult {
  enum class Code : std::uint8_t { ok = 0, cancelled = 1, too_few_tests = 2, bad_data = 3 };
  Code code = Code::ok;
  std::string message;  ///< one line
  CoefficientSet coefficients;
  CoefficientRecord record;  ///< the same with tool, engagement and covariance, for the database
  bool reset = false;        ///< answers a goal with reset: no coefficients
  std::uint64_t id = 0;      ///< of the goal
};

/// Mean of one test.
struct LoadTest {
  CuttingCondition condition;
  double speed = 0.0;      ///< [rad/s] mean
  double speed_std = 0.0;  ///< [rad/s] of the mean
  MeanVoltage voltage;
  std::vector<double> voltages;  ///< [V] steady readings
  std::vector<double> times;     ///< [s] of them, since the first
  int readings = 0;
  double stamp = 0.0;     ///< [s] of its last reading
  double duration = 0.0;  ///< [s] steady
  std::optional<MotorReading> motor;
  std::optional<MotorForce> force;     ///< of a cut, where motors are calibrated
  std::optional<ForceReading> sensor;  ///< of a force sensor, where one is listened to

  /// Mean of the readings. @param step [V] of the load meter.
  void takeMean(const Spindle& spindle, double step);
  double variance() const;  ///< [V2] of the readings; 0 without any
  /// Standard deviation of the mean torque at the motor as one of the voltage: meter and speed [V].
  double torqueStdAsVoltage() const;
};

/// From controller state and load to cutting coefficients (Dunwoody chapter 3). Fed in stamp order; time
/// comes from the stamps only, so live, replayed and offline runs agree. A test is one cut/condition from its
/// stamp to the next one's: in air, readings at steady speed count; in a cut, readings while the tool moves
/// between steady_from and steady_to; both after a settling time of the load meter's lag.
class LoadMeterIdentification {
 public:
  /// Uses the model's load meter and, without air cuts only, its friction; never its cutting section.
  /// @throws Error when the model lacks the spindle or load_meter_full_scale_v, or a parameter is out of
  /// range.
  LoadMeterIdentification(const MachineModel& model, const IdentificationParameters& parameters);

  void onResult(std::function<void(const IdentifyResult&)> callback) { result_ = std::move(callback); }
  /// Uses motor currents too. Tests made so far keep what they had.
  void setMotors(const MotorCalibration& calibration) { motors_ = calibration; }
  /// Uses motor currents, and calibrates them by the session's own air moves and cuts (SelfCalibration).
  void learnMotors() { learnt_.emplace(parameters_.motor); }
  /// How far a drive follows its load [Hz], by the moves in rapid traverse so far.
  const std::optional<Estimate>& driveBandwidth(std::size_t axis) const { return moves_.bandwidth(axis); }
  /// What the session itself says of the motors; empty without learnMotors(), or before anything was learnt.
  std::optional<MotorCalibration> learntMotors() const;
  /// Force of each cut by its motors.
  void onMotorForce(std::function<void(const MotorForce&)> callback) { motor_force_ = std::move(callback); }
  /// Force of each cut by all that was measured of it.
  void onForce(std::function<void(const ForceEstimate&)> callback) { force_ = std::move(callback); }
  /// The same while a cut is steady: of its last ForceEstimateParameters::window, each period.
  void onForceWindow(std::function<void(const ForceEstimate&)> callback) { window_ = std::move(callback); }
  void onTest(std::function<void(const LoadTest&)> callback) { test_ = std::move(callback); }
  /// Every cut whose friction is known, for the database: condition, age of the edge, and the running
  /// estimate with it, whose standard deviations are those of one cut among as many as it rests on, so that
  /// the records of a run of cuts say together what the run does.
  void onCut(std::function<void(const CoefficientRecord&)> callback) { cut_ = std::move(callback); }

  void handle(const CncState& state);
  void handle(const LoadSample& sample);
  /// Topic daq/motor_current: channels x, y, z, spindle [A], phase currents by Hall sensors; or daq/servo, a
  /// record of Servo Guide, of which what comes after its trigger counts.
  void handle(const SampleBlock& block);
  /// Topic force/compensated: what a force sensor shows of the tool's force.
  void handle(const ForceBlock& block);
  void handle(const CuttingCondition& condition);
  void handle(const IdentifyGoal& goal);

  /// As new: a bag was restarted.
  void reset();

  /// Ktc and Kte followed cut by cut since the tool or the material changed; empty before a cut with known
  /// friction.
  const std::optional<RecursiveCoefficients>& production() const { return production_; }

  const std::vector<LoadTest>& airCuts() const { return air_cuts_; }
  const std::vector<LoadTest>& cuts() const { return cuts_; }

 private:
  struct Reading {
    double stamp, voltage, speed;
  };
  bool onPath(const CncState& state) const;
  void dropAfter(double stamp);
  bool counts(double stamp) const;
  std::optional<Estimate> cuttingTorque(const LoadTest& cut) const;
  std::optional<ForceEstimate> estimate(const LoadTest& cut, bool without_motors = false) const;
  bool readsMotors() const { return motors_ || learnt_; }
  std::string motorsText() const;
  void lookBack(double now);
  void closeTest();
  LoadTest steadyTest(double since = -1e300) const;
  void keep(LoadTest test);
  void follow(const LoadTest& cut);
  void tell(const LoadTest& cut);
  IdentifyResult identify(const IdentifyGoal& goal) const;
  std::string addFromMotors(const std::vector<LoadTest>& cuts, CoefficientRecord* record) const;
  void readMotorsOf(LoadTest* test, const MotorRecord& record, bool is_short) const;

  std::string file_;
  Spindle spindle_;
  double spindle_uncertainty_;
  IdentificationParameters parameters_;
  std::function<void(const IdentifyResult&)> result_;
  std::function<void(const LoadTest&)> test_;
  std::function<void(const CoefficientRecord&)> cut_;
  std::map<std::string, double> edge_age_;  // [s] of cutting, by tool

  std::optional<CuttingCondition> condition_;
  std::optional<double> speed_since_, path_since_;  // [s] steady since then
  double last_reading_ = 0.0, last_state_ = 0.0;    // [s]
  std::vector<Reading> readings_;
  MotorRecord motor_record_;
  ForceRecord force_record_;
  std::function<void(const ForceEstimate&)> force_, window_;
  double next_window_ = 0.0;  // [s]
  std::optional<MotorCalibration> motors_;
  std::optional<SelfCalibration> learnt_;
  DriveMoves moves_;
  std::function<void(const MotorForce&)> motor_force_;
  struct PathPoint {
    double stamp;
    std::array<double, 3> position;
  };
  std::optional<PathPoint> path_first_, path_last_;  // of the steady cut, or of moving along its line in air
  std::vector<LoadTest> air_cuts_, cuts_;
  std::optional<RecursiveCoefficients> production_;
  std::string production_of_;         // tool and material
  std::vector<std::string> dropped_;  // why tests were not used
  std::string bad_data_;
};

/// Step of readings [V]: the model's resolution, or a coarser one that they show (a controller may round
/// again).
double stepOf(const std::vector<double>& readings, double resolution);

/// Friction torque in a test, and how it hangs on what was found in the air cuts.
struct IdleTorque {
  std::function<double(const LoadTest&)> torque;                 ///< [N m]
  std::function<std::vector<double>(const LoadTest&)> gradient;  ///< to the unknowns
  std::size_t unknowns = 0;
  std::vector<double> covariance;                             ///< of the unknowns, row by row
  double viscous = std::numeric_limits<double>::quiet_NaN();  ///< [N m s/rad] found in the air cuts
  double coulomb = std::numeric_limits<double>::quiet_NaN();  ///< [N m]
};
/// From the air cuts, the law by evidence (Coulomb and viscous; Stribeck, warm-up from five air cuts on); the
/// model's without any. @throws Error with air cuts at fewer than two speeds.
IdleTorque idleTorque(const std::vector<LoadTest>& air_cuts, const Spindle& spindle,
                      double spindle_uncertainty_percent);

/// What the tests of a session say.
struct SessionResult {
  CoefficientRecord record;  ///< with covariance, and means of tool and engagement
  std::string found;         ///< runout, wear and friction that the evidence added; empty: nothing
};
/// Coefficients and their standard deviations by the estimator of campaign_identification.h, each test a mean
/// of steady readings: friction from the air cuts (the model's without any), mean torque (eq. 3.5, 3.19 for
/// any engagement), and the runout from the cuts' means and the ripple their readings show. @param
/// largest_runout [m]; 0: none.
/// @throws Error naming what is missing.
SessionResult identifyFromTests(std::vector<LoadTest> air_cuts, std::vector<LoadTest> cuts,
                                const Spindle& spindle, double spindle_uncertainty_percent,
                                double largest_runout = 0.0);

}  // namespace smartmill::loadmeter
