#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "smartmill_core/model/machine_model.h"
#include "smartmill_core/signal/streams.h"
#include "smartmill_loadmeter/database/database.h"
#include "smartmill_loadmeter/identification/cut_forces.h"
#include "smartmill_loadmeter/identification/identification_parameters.h"
#include "smartmill_loadmeter/identification/production_run.h"
#include "smartmill_loadmeter/identification/session_identification.h"
#include "smartmill_loadmeter/identification/steady_record.h"
#include "smartmill_loadmeter/inspection/cut_history.h"
#include "smartmill_loadmeter/inspection/inspection_record.h"

namespace smartmill::loadmeter {

/// Callbacks; may be empty.
struct IdentificationOutputs {
  std::function<void(const IdentifyResult&)> result;   ///< of each goal
  std::function<void(const LoadTest&)> test;           ///< each test
  std::function<void(const CoefficientRecord&)> cut;   ///< record of each cut for the database
  std::function<void(const MotorForce&)> motor_force;  ///< of each cut by its motors
  std::function<void(const ForceEstimate&)> force;     ///< of each cut by all its measurements
  /// The same each period of a steady cut, for its last ForceEstimateParameters::window.
  std::function<void(const ForceEstimate&)> force_window;
  std::function<void(const InspectionResult&)> inspected;  ///< of each measured dimension of a part
};

/// Identifies cutting coefficients from controller state and load (Dunwoody, chapter 3). Inputs are in stamp
/// order; time is taken from the stamps only, so that live, replayed and offline results agree. A test
/// extends from one cut/condition to the next; its steady part (SteadyRecord) is evaluated.
class LoadMeterIdentification {
 public:
  /// Uses the model's load meter and, without air cuts, its friction; never its cutting section.
  /// @throws Error when the model lacks the spindle or load_meter_full_scale_v, or a parameter is out of
  /// range.
  LoadMeterIdentification(const MachineModel& model, const IdentificationParameters& parameters);

  IdentificationOutputs& outputs() { return outputs_; }
  CutForces& forces() { return forces_; }
  const CutForces& forces() const { return forces_; }
  const TemperatureWatch& temperature() const { return temperature_; }

  void handle(const CncState& state);
  void handle(const LoadSample& sample);
  /// Topic machine/temperature.
  void handle(const MachineTemperature& temperature) { temperature_.handle(temperature); }
  /// Topic daq/motor_current: phase currents [A] in channels x, y, z, spindle; or daq/servo, a record of
  /// Servo Guide, used from its trigger on.
  void handle(const SampleBlock& block);
  /// Topic force/compensated: force on the tool by a force sensor.
  void handle(const ForceBlock& block) { steady_.handle(block); }
  void handle(const CuttingCondition& condition);
  void handle(const IdentifyGoal& goal);
  /// Topic inspection/feature, of a cut of this run.
  void handle(const InspectionFeature& feature);

  /// Returns to the initial state (a bag was restarted).
  void reset();

  /// Running estimate of Ktc and Kte of the last cut's tool and material; empty before a cut with known
  /// friction.
  const std::optional<RecursiveCoefficients>& production() const { return production_.estimate(); }

  const std::string& productionTool() const { return production_.tool(); }

  const std::vector<LoadTest>& airCuts() const { return session_.air_cuts; }
  const std::vector<LoadTest>& cuts() const { return session_.cuts; }

 private:
  void estimateWindow(double now);
  void closeTest();
  void storeTest(LoadTest test);
  std::optional<Estimate> torqueOf(const LoadTest& cut) const;

  Spindle spindle_;
  double spindle_uncertainty_;
  IdentificationParameters parameters_;
  IdentificationOutputs outputs_;
  SteadyRecord steady_;
  CutForces forces_;
  TemperatureWatch temperature_;
  ProductionRun production_;
  SessionTests session_;
  CutHistory made_;
  double next_window_ = 0.0;  // [s]
};

}  // namespace smartmill::loadmeter
