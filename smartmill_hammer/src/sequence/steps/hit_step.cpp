#include "hit_step.h"

#include <utility>

namespace smartmill::hammer {

StepOutcome HitStep::begin(double now) {
  control_.strike(now);
  return StepOutcome::running();
}

StepOutcome HitStep::hitRecorded(double now, RecordedHit&& hit) {
  if (hit.fault.text.empty()) hit.fault = faultOf(hit.hit);
  if (!hit.fault.text.empty()) return reject(now, hit.fault);
  measurement_.bad_hits = 0;
  return hitAccepted(now, std::move(hit));
}

HitCheckOptions HitStep::checkOptions() const {
  const HammerParameters& p = measurement_.parameters;
  return {p.weak_force, p.second_hit_share, p.range_share * measurement_.station.range_volt, p.force_high};
}

StepOutcome HitStep::reject(double now, const HitFault& fault) {
  if (++measurement_.bad_hits > measurement_.parameters.max_bad_hits)
    return tooManyRejected(
        fault.bad_data ? FrfCode::bad_data : FrfCode::no_hit,
        std::to_string(measurement_.bad_hits) + " rejected hits in a row, the last: " + fault.text);
  // The panel recognises a rejected hit by this prefix.
  measurement_.report("hit thrown away: " + fault.text, measurement_.hitProgress());
  control_.strikeAfterRest(now);
  return StepOutcome::running();
}

StepOutcome HitStep::tooManyRejected(FrfCode code, const std::string& reason) {
  return StepOutcome::failed(code, reason);
}

}  // namespace smartmill::hammer
