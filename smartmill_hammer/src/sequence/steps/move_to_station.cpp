#include "sequence/steps/steps.h"

namespace smartmill::hammer {
namespace {

class OrientSpindle : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  StepOutcome begin(double) override {
    measurement_.report("waiting for the controller's state", 0.0);
    control_.start(measurement_.goal.stamp, measurement_.goal.direction);
    return StepOutcome::running();
  }
  StepOutcome motionDone(double now) override {
    if (control_.hasCommanded()) return StepOutcome::done();
    measurement_.report("stopping and orienting the spindle", 0.02);
    control_.orient(now, measurement_.parameters.start_angle);
    return StepOutcome::running();
  }
};

class MoveToStation : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  bool watchesRange() const override { return true; }
  StepOutcome begin(double now) override {
    if (measurement_.turned && !control_.hasCrossSensor())
      return StepOutcome::failed(FrfCode::bad_data,
                                 "daq/hammer: expected the channel gap_cross, since frames.hammer is turned");
    measurement_.report("moving to the hammer station " + measurement_.goal.direction, 0.05);
    measurement_.at_station = true;
    const Axes3 here = control_.position()->position;
    control_.move(now, here, measurement_.paths.approach(here));
    return StepOutcome::running();
  }
  StepOutcome motionDone(double) override { return StepOutcome::done(); }
};

}  // namespace

StepPtr orientSpindle(Measurement& measurement, StationControl& control) {
  return std::make_unique<OrientSpindle>(measurement, control);
}
StepPtr moveToStation(Measurement& measurement, StationControl& control) {
  return std::make_unique<MoveToStation>(measurement, control);
}

}  // namespace smartmill::hammer
