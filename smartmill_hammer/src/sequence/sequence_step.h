#pragma once

#include <memory>
#include <string>
#include <vector>

#include "measurement.h"
#include "station_control.h"

namespace smartmill::hammer {

/// What follows an input that a step has handled.
struct StepOutcome {
  enum class Kind {
    running,         ///< the step has sent a command or waits
    done,            ///< the next step begins
    hits_completed,  ///< the remaining steps are skipped, the hits recorded so far are evaluated
    failed           ///< the measurement is aborted
  };
  Kind kind = Kind::running;
  FrfCode code = FrfCode::ok;
  std::string reason;  ///< of a failure, one line

  static StepOutcome running() { return {}; }
  static StepOutcome done() { return {Kind::done, FrfCode::ok, {}}; }
  static StepOutcome hitsCompleted() { return {Kind::hits_completed, FrfCode::ok, {}}; }
  static StepOutcome failed(FrfCode code, const std::string& reason) { return {Kind::failed, code, reason}; }
};

/// One step of a HammerSequence. begin() sends the first command; each completion that the step has commanded
/// comes back in one of the other functions, which sends the next command or ends the step. A step shares
/// data with others through the Measurement alone.
///
/// To add a step: derive a class in a file of its own in steps/, declare its factory in steps/steps.h, and
/// insert it into sequenceSteps() (step_list.cpp).
class SequenceStep {
 public:
  SequenceStep(Measurement& measurement, StationControl& control)
      : measurement_(measurement), control_(control) {}
  virtual ~SequenceStep() = default;

  /// Evaluated when the step's turn comes; false: it is skipped.
  virtual bool isNeeded() const { return true; }
  /// Whether a sensor at the end of its range ends the measurement: while the tool moves before the sensor
  /// without a calibration.
  virtual bool watchesRange() const { return false; }

  virtual StepOutcome begin(double now) = 0;
  virtual StepOutcome motionDone(double /*now*/) { return StepOutcome::running(); }
  virtual StepOutcome voltageMeasured(double /*now*/, const MeanVoltage& /*voltage*/) {
    return StepOutcome::running();
  }
  virtual StepOutcome hitRecorded(double /*now*/, RecordedHit&& /*hit*/) { return StepOutcome::running(); }

 protected:
  StepOutcome measureVoltageAfter(double now, double delay) {
    control_.measureVoltage(now + delay);
    return StepOutcome::running();
  }
  /// [m] moved towards the sensor of an axis since the station's position
  double moved(std::size_t axis) const {
    return control_.target()[axis] - measurement_.paths.station()[axis];
  }

  Measurement& measurement_;
  StationControl& control_;
};

using StepPtr = std::unique_ptr<SequenceStep>;

/// All steps of a measurement in their order.
std::vector<StepPtr> sequenceSteps(Measurement& measurement, StationControl& control);

}  // namespace smartmill::hammer
