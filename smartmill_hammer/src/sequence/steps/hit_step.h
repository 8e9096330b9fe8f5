#pragma once

#include <string>

#include "sequence/sequence_step.h"
#include "smartmill_core/modal/hit_check.h"

namespace smartmill::hammer {

/// A step that strikes: a rejected hit is repeated after the rest time, up to `max_bad_hits` in a row.
class HitStep : public SequenceStep {
 public:
  using SequenceStep::SequenceStep;

  StepOutcome begin(double now) override;
  StepOutcome hitRecorded(double now, RecordedHit&& hit) final;

 protected:
  virtual HitFault faultOf(const Hit& hit) const = 0;
  virtual StepOutcome hitAccepted(double now, RecordedHit hit) = 0;
  virtual StepOutcome tooManyRejected(FrfCode code, const std::string& reason);

  HitCheckOptions checkOptions() const;
  StepOutcome reject(double now, const HitFault& fault);
};

}  // namespace smartmill::hammer
