#include "sequence/steps/steps.h"

namespace smartmill::hammer {
namespace {

class LowerToSecondHeight : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  bool isNeeded() const override { return measurement_.needsSecondHeight(); }
  bool watchesRange() const override { return true; }
  StepOutcome begin(double now) override {
    measurement_.at_second_height = true;
    measurement_.bad_hits = 0;
    measurement_.report("lowering the tool for hits at a second height", 0.83);
    const Axes3 here = control_.position()->position;
    control_.move(now, here, measurement_.paths.toSecondHeight(here, measurement_.lowered()));
    return StepOutcome::running();
  }
  StepOutcome motionDone(double) override { return StepOutcome::done(); }
};

class TurnFluteAtSecondHeight : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  bool isNeeded() const override { return measurement_.at_second_height; }
  bool watchesRange() const override { return true; }
  StepOutcome begin(double now) override {
    measurement_.report("turning the flute to the hammer at the second height", 0.84);
    // The helix turns the flute on in proportion to the height.
    const MeasureFrfResult& found = measurement_.result;
    control_.orient(now, found.flute_low + (found.flute_hammer - found.flute_low) *
                                               (1.0 + measurement_.lowered() / measurement_.station.offset));
    return StepOutcome::running();
  }
  StepOutcome motionDone(double) override { return StepOutcome::done(); }
};

}  // namespace

StepPtr lowerToSecondHeight(Measurement& measurement, StationControl& control) {
  return std::make_unique<LowerToSecondHeight>(measurement, control);
}
StepPtr turnFluteAtSecondHeight(Measurement& measurement, StationControl& control) {
  return std::make_unique<TurnFluteAtSecondHeight>(measurement, control);
}

}  // namespace smartmill::hammer
