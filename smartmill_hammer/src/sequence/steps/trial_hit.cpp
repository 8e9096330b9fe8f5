#include <algorithm>

#include "hit_step.h"
#include "sequence/steps/steps.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/signal/statistics.h"

namespace smartmill::hammer {
namespace {

class TrialHit : public HitStep {
 public:
  using HitStep::HitStep;

  StepOutcome begin(double now) override {
    measurement_.report("a trial hit, before the tool nears the sensor", 0.59);
    return HitStep::begin(now);
  }

 private:
  /// Of the force alone: the tool is too far from the sensor for its response to be checked.
  HitFault faultOf(const Hit& hit) const override {
    Hit force_only = hit;
    force_only.response = force_only.force;
    HitCheckOptions options = checkOptions();
    options.response_range = 0.0;
    return hitFault(force_only, options);
  }

  /// By the nominal curve, which overestimates the swing far from the sensor and in front of a flank.
  StepOutcome hitAccepted(double, RecordedHit recorded) override {
    const Hit& hit = recorded.hit;
    const auto quiet = static_cast<std::ptrdiff_t>(std::max<std::size_t>(1, hit.pre_trigger / 2));
    const std::vector<double> before(hit.response.begin(), hit.response.begin() + quiet);
    const double rest = mean(before), noise = 3.0 * standardDeviation(before);
    const double top = *std::max_element(hit.response.begin(), hit.response.end());
    const SensorApproach& approach = measurement_.approach;
    const double swing =
        measurement_.parameters.largest_swing *
        std::max(0.0, approach.nominalGap(rest) - approach.nominalGap(std::max(rest, top - noise)));
    measurement_.swing = std::min(swing, measurement_.station.gap_at_zero_volt);
    measurement_.report(
        formatted("a hit swings the tool by %.0f um at most towards the sensor", 1e6 * *measurement_.swing),
        0.6);
    return StepOutcome::done();
  }
};

}  // namespace

StepPtr trialHit(Measurement& measurement, StationControl& control) {
  return std::make_unique<TrialHit>(measurement, control);
}

}  // namespace smartmill::hammer
