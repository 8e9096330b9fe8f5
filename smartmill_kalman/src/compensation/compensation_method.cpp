#include "smartmill_kalman/compensation/compensation_method.h"

#include <algorithm>
#include <utility>

#include "smartmill_core/error.h"
#include "smartmill_kalman/compensation/delay_compensation.h"
#include "smartmill_kalman/compensation/fixed_lag_compensation.h"
#include "smartmill_kalman/compensation/harmonic_compensation.h"

namespace smartmill::kalman {

void CompensationParameters::validate() const {
  checkBounds(*this);
  // Mode tracking needs the angle of the teeth, which cannot be estimated from the force alone.
  if (track_speed.isAlways() && follow)
    throw Error("track_speed: always, expected auto or never with follow (needs spindle/angle)");
  if (delay_form && (track_speed.isAlways() || follow || lag > 0.0)) {
    throw Error(
        "delay_form: true, expected false with track_speed always, follow or lag > 0 (they need harmonics)");
  }
}

CompensationParameters CompensationParameters::withSpeed(bool estimated) const {
  CompensationParameters result = *this;
  result.track_speed = estimated;
  if (estimated)
    result.filter.memory_revolutions = std::min(filter.memory_revolutions, estimated_speed_memory);
  return result;
}

std::unique_ptr<CompensationMethod> makeCompensationMethod(const CompensationParameters& parameters,
                                                           ForceOutputs outputs) {
  if (parameters.delay_form) return std::make_unique<DelayCompensation>(parameters, std::move(outputs));
  if (parameters.lag > 0.0) return std::make_unique<FixedLagCompensation>(parameters, std::move(outputs));
  return std::make_unique<HarmonicCompensation>(parameters, std::move(outputs));
}

}  // namespace smartmill::kalman
