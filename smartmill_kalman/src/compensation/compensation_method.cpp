#include "smartmill_kalman/compensation/compensation_method.h"

#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_kalman/compensation/delay_compensation.h"
#include "smartmill_kalman/compensation/fixed_lag_compensation.h"
#include "smartmill_kalman/compensation/harmonic_compensation.h"

namespace smartmill::kalman {

void CompensationParameters::validate() const {
  checkBounds(*this);
  // Mode tracking needs the angle of the teeth, which cannot be estimated from the force alone.
  if (track_speed && follow)
    throw Error("track_speed: true, expected false with follow (needs spindle/angle)");
  if (delay_form && (track_speed || follow || lag > 0.0))
    throw Error("delay_form: true, expected false with track_speed, follow or lag > 0 (they need harmonics)");
}

std::unique_ptr<CompensationMethod> makeCompensationMethod(const CompensationParameters& parameters,
                                                           ForceOutputs outputs) {
  if (parameters.delay_form) return std::make_unique<DelayCompensation>(parameters, std::move(outputs));
  if (parameters.lag > 0.0) return std::make_unique<FixedLagCompensation>(parameters, std::move(outputs));
  return std::make_unique<HarmonicCompensation>(parameters, std::move(outputs));
}

}  // namespace smartmill::kalman
