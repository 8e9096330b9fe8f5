#pragma once

#include <cstddef>
#include <vector>

#include "sequence_step.h"

namespace smartmill::hammer {

/// Runs the steps of a measurement in their order; those that are not needed are skipped.
class StepRunner {
 public:
  StepRunner(Measurement& measurement, StationControl& control);

  /// Begins the first step.
  StepOutcome begin(double now);
  /// Passes an event to the running step. @return running, failed, or hits_completed once no step remains
  StepOutcome handle(double now, ControlEvent event);

 private:
  /// Begins the next step as long as one ends at once.
  StepOutcome proceed(double now, StepOutcome outcome);

  StationControl& control_;
  std::vector<StepPtr> steps_;
  std::size_t step_ = 0;
};

}  // namespace smartmill::hammer
