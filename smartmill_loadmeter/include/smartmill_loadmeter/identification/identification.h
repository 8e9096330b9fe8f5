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
  MotorParameters motor;          ///< for daq/motor_current
  ForceEstimateParameters force;  ///< for the force of each cut

  /// Without those of `motor` and `force`, whose keys have a prefix.
  void declare(ParameterTable& table) {
    table.number("speed_tolerance", speed_tolerance, "1", Range::open(0.0, 0.5),
                 "share of the commanded spindle speed within which the speed is reached");
    table.number(
        "settle_time_constants", settle_time_constants, "1", Range::closed(5.0, 1000.0),
        "waiting time after a change in time constants of the load meter; after 8, 0.03 % of a step remains");
    table.number("guard_time", guard_time, "s", Range::closed(0.0, 10.0),
                 "readings dropped before the end of a steady state, because stamps are times of replies");
    table.number("path_tolerance", path_tolerance, "m", Range::openLow(0.0, 1.0),
                 "largest distance from the line between steady_from and steady_to");
    table.number("minimum_readings", minimum_readings, "1", Range::atLeast(2),
                 "steady readings that a test must have");
    table.number("maximum_gap", maximum_gap, "s", Range::openLow(0.0, 60.0),
                 "longest time without controller state or load in a steady state");
    table.number("production_memory", production_memory, "s", Range::openLow(0.0, 1e7),
                 "cutting time after which the weight of a cut in the running estimate is 1/e");
    table.number("largest_runout", largest_runout, "m", Range::closed(0.0, 1e-3),
                 "largest possible offset of the cutter axis; 0.0: runout is not estimated");
  }
  /// @throws Error with key and value.
  void validate() const;
};

/// Goal of the action IdentifyCoefficients.
struct IdentifyGoal {
  double stamp = 0.0;    ///< [s]
  std::string tool;      ///< empty: any
  std::string material;  ///< empty: any
  bool reset = false;    ///< discard earlier tests
  std::uint64_t id = 0;  ///< returned with the result
};

struct IdentifyResult {
  enum class Code : std::uint8_t { ok = 0, cancelled = 1, too_few_tests = 2, bad_data = 3 };
  Code code = Code::ok;
  std::string message;  ///< one line
  CoefficientSet coefficients;
  CoefficientRecord record;  ///< the same with tool, engagement and covariance, for the database
  bool reset = false;        ///< reply to a goal with reset, without coefficients
  std::uint64_t id = 0;      ///< of the goal
};

/// Steady state of one test.
struct LoadTest {
  CuttingCondition condition;
  double speed = 0.0;      ///< [rad/s] mean
  double speed_std = 0.0;  ///< [rad/s] of the mean
  MeanVoltage voltage;
  std::vector<double> voltages;  ///< [V] steady readings
  std::vector<double> times;     ///< [s] of `voltages`, since the first
  int readings = 0;
  double stamp = 0.0;     ///< [s] of its last reading
  double duration = 0.0;  ///< [s] steady
  std::optional<MotorMeasurement> motor;
  std::optional<MotorForce> force;         ///< of a cut, with calibrated motors
  std::optional<ForceMeasurement> sensor;  ///< by a force sensor, if used

  /// Computes `voltage` from the readings. @param step [V] resolution of the load meter.
  void computeMean(const Spindle& spindle, double step);
  double variance() const;  ///< [V2] of the readings; 0 without any
  /// Standard deviation [V] of the mean voltage that corresponds to that of the torque at the motor, by load
  /// meter and speed.
  double torqueStdAsVoltage() const;
};

/// Identifies cutting coefficients from controller state and load (Dunwoody, chapter 3). Inputs are in stamp
/// order; time is taken from the stamps only, so that live, replayed and offline results agree. A test
/// extends from one cut/condition to the next. Readings are used in an air cut at steady speed, and in a cut
/// while the tool moves between steady_from and steady_to, in both cases after the load meter has settled.
class LoadMeterIdentification {
 public:
  /// Uses the model's load meter and, without air cuts, its friction; never its cutting section.
  /// @throws Error when the model lacks the spindle or load_meter_full_scale_v, or a parameter is out of
  /// range.
  LoadMeterIdentification(const MachineModel& model, const IdentificationParameters& parameters);

  void onResult(std::function<void(const IdentifyResult&)> callback) { on_result_ = std::move(callback); }
  /// Also uses motor currents, from the next test on.
  void setMotors(const MotorCalibration& calibration) { motors_ = calibration; }
  /// Also uses motor currents, calibrated by the session's own air moves and cuts (SelfCalibration).
  void enableSelfCalibration() { self_calibration_.emplace(parameters_.motor); }
  /// Bandwidth [Hz] of a feed drive's lag from the rapid moves so far.
  const std::optional<Estimate>& driveBandwidth(std::size_t axis) const { return moves_.bandwidth(axis); }
  /// Calibration from the session itself; empty: not enabled, or too few cuts.
  std::optional<MotorCalibration> selfCalibration() const;
  /// Called with the force of each cut by its motors.
  void onMotorForce(std::function<void(const MotorForce&)> callback) {
    on_motor_force_ = std::move(callback);
  }
  /// Called with the force of each cut by all its measurements.
  void onForce(std::function<void(const ForceEstimate&)> callback) { on_force_ = std::move(callback); }
  /// The same each period of a steady cut, for its last ForceEstimateParameters::window.
  void onForceWindow(std::function<void(const ForceEstimate&)> callback) { on_window_ = std::move(callback); }
  void onTest(std::function<void(const LoadTest&)> callback) { on_test_ = std::move(callback); }
  /// Called with every cut whose friction is known, for the database: condition, age of the edge and the
  /// running estimate. The standard deviations are those of one of the n cuts in the estimate, so that the
  /// combined records of a sequence of cuts are as certain as the estimate.
  void onCut(std::function<void(const CoefficientRecord&)> callback) { on_cut_ = std::move(callback); }

  void handle(const CncState& state);
  void handle(const LoadSample& sample);
  /// Topic daq/motor_current: phase currents [A] in channels x, y, z, spindle; or daq/servo, a record of
  /// Servo Guide, used from its trigger on.
  void handle(const SampleBlock& block);
  /// Topic force/compensated: force on the tool by a force sensor.
  void handle(const ForceBlock& block);
  void handle(const CuttingCondition& condition);
  void handle(const IdentifyGoal& goal);

  /// Returns to the initial state (a bag was restarted).
  void reset();

  /// Running estimate of Ktc and Kte since the last change of tool or material; empty before a cut with known
  /// friction.
  const std::optional<RecursiveCoefficients>& production() const { return production_; }

  const std::vector<LoadTest>& airCuts() const { return air_cuts_; }
  const std::vector<LoadTest>& cuts() const { return cuts_; }

 private:
  /// Data of the steady state of the present test.
  struct SteadyRecord {
    struct Sample {
      double stamp, voltage, speed;
    };
    std::vector<Sample> readings;  // of the load meter
    MotorRecord motor;
    ForceRecord force;

    void dropAfter(double stamp, bool with_readings = true);
    void clear(bool with_readings = true);
  };
  bool onPath(const CncState& state) const;
  bool isSteadyAt(double stamp) const;
  std::optional<Estimate> cuttingTorqueOf(const LoadTest& cut) const;
  std::optional<ForceEstimate> estimate(const LoadTest& cut, bool without_motors = false) const;
  bool usesMotors() const { return motors_ || self_calibration_; }
  std::string selfCalibrationText() const;
  void estimateWindow(double now);
  void closeTest();
  LoadTest steadyTest(double since = -1e300) const;
  void storeTest(LoadTest test);
  void updateProduction(const LoadTest& cut);
  void reportCut(const LoadTest& cut);
  IdentifyResult identify(const IdentifyGoal& goal) const;
  std::string addMotorCoefficients(const std::vector<LoadTest>& cuts, CoefficientRecord* record) const;
  void addMotorMeasurement(LoadTest* test, const MotorRecord& record, bool is_short) const;

  std::string file_;
  Spindle spindle_;
  double spindle_uncertainty_;
  IdentificationParameters parameters_;
  std::function<void(const IdentifyResult&)> on_result_;
  std::function<void(const LoadTest&)> on_test_;
  std::function<void(const CoefficientRecord&)> on_cut_;
  std::map<std::string, double> edge_age_;  // [s] cutting time by tool

  std::optional<CuttingCondition> condition_;
  std::optional<double> at_speed_since_, on_path_since_;  // [s] start of the steady state
  double last_load_ = 0.0, last_state_ = 0.0;             // [s]
  SteadyRecord steady_;
  std::function<void(const ForceEstimate&)> on_force_, on_window_;
  double next_window_ = 0.0;  // [s]
  std::optional<MotorCalibration> motors_;
  std::optional<SelfCalibration> self_calibration_;
  DriveMoves moves_;
  std::function<void(const MotorForce&)> on_motor_force_;
  struct PathPoint {
    double stamp;
    std::array<double, 3> position;
  };
  std::optional<PathPoint> path_first_, path_last_;  // of the path in a cut, or along its line in air
  std::vector<LoadTest> air_cuts_, cuts_;
  std::optional<RecursiveCoefficients> production_;
  std::string production_of_;                // tool and material
  std::vector<std::string> rejected_tests_;  // reasons
  std::string bad_data_;
};

/// Resolution of readings [V]: the model's, or a coarser one that they show (a controller may round again).
double resolutionOf(const std::vector<double>& readings, double resolution);

/// Friction torque of a test as a function of the unknowns fitted to the air cuts.
struct IdleTorque {
  std::function<double(const LoadTest&)> torque;                 ///< [N m]
  std::function<std::vector<double>(const LoadTest&)> gradient;  ///< with respect to the unknowns
  std::size_t unknowns = 0;
  std::vector<double> covariance;                             ///< of the unknowns, row by row
  double viscous = std::numeric_limits<double>::quiet_NaN();  ///< [N m s/rad] fitted to the air cuts
  double coulomb = std::numeric_limits<double>::quiet_NaN();  ///< [N m]
};
/// Fits the friction law with the strongest evidence to the air cuts (Stribeck and warm-up terms from five
/// air cuts on); without air cuts, the model's friction. @throws Error with air cuts at fewer than two
/// speeds.
IdleTorque idleTorque(const std::vector<LoadTest>& air_cuts, const Spindle& spindle,
                      double spindle_uncertainty_percent);

/// Coefficients from the tests of a session.
struct SessionResult {
  CoefficientRecord record;  ///< with covariance, and means of tool and engagement
  std::string found;         ///< terms added by evidence, runout and notes, for messages; may be empty
};
/// Coefficients by the estimator of campaign_identification.h, each test a mean of steady readings
/// (eq. 3.5, 3.19 for any engagement), with the runout from the cuts' means and the ripple of their readings.
/// @param largest_runout [m]; 0: none.
/// @throws Error with what is missing.
SessionResult identifyFromTests(std::vector<LoadTest> air_cuts, std::vector<LoadTest> cuts,
                                const Spindle& spindle, double spindle_uncertainty_percent,
                                double largest_runout = 0.0);

}  // namespace smartmill::loadmeter
