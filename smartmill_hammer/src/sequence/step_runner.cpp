#include "step_runner.h"

#include <utility>

namespace smartmill::hammer {

StepRunner::StepRunner(Measurement& measurement, StationControl& control)
    : control_(control), steps_(sequenceSteps(measurement, control)) {
}

StepOutcome StepRunner::begin(double now) {
  return proceed(now, steps_[step_]->begin(now));
}

StepOutcome StepRunner::handle(double now, ControlEvent event) {
  SequenceStep& step = *steps_[step_];
  if (std::holds_alternative<MotionDone>(event)) return proceed(now, step.motionDone(now));
  if (const auto* voltage = std::get_if<MeanVoltage>(&event))
    return proceed(now, step.voltageMeasured(now, *voltage));
  if (auto* hit = std::get_if<RecordedHit>(&event))
    return proceed(now, step.hitRecorded(now, std::move(*hit)));
  return StepOutcome::running();
}

StepOutcome StepRunner::proceed(double now, StepOutcome outcome) {
  while (outcome.kind == StepOutcome::Kind::done) {
    do {
      if (++step_ == steps_.size()) return StepOutcome::hitsCompleted();
    } while (!steps_[step_]->isNeeded());
    control_.watchRange(steps_[step_]->watchesRange());
    outcome = steps_[step_]->begin(now);
  }
  return outcome;
}

}  // namespace smartmill::hammer
