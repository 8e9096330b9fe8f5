#include <utility>

#include "hit_step.h"
#include "sequence/frf_evaluation.h"
#include "sequence/steps/steps.h"

namespace smartmill::hammer {
namespace {

/// Strikes until the goal's hits are accepted or the FRF is as precise as required.
class CollectHits : public HitStep {
 public:
  using HitStep::HitStep;

  StepOutcome begin(double now) override {
    measurement_.result.sensitivity = measurement_.first.sensor.sensitivity;
    measurement_.result.sensitivity_std = measurement_.first.sensor.sensitivity_std;
    return HitStep::begin(now);
  }

 private:
  HitFault faultOf(const Hit& hit) const override { return hitFault(hit, checkOptions()); }

  StepOutcome hitAccepted(double now, RecordedHit recorded) override {
    std::vector<Hit>& hits = measurement_.height().hits;
    std::vector<Hit>& cross = measurement_.cross.hits;
    hits.push_back(std::move(recorded.hit));
    if (recorded.cross && !measurement_.at_second_height) cross.push_back(std::move(*recorded.cross));
    const std::vector<HitFault> faults = faultsAmongHits(hits, std::vector<bool>(hits.size(), true));
    for (std::size_t h = 0; h < hits.size(); ++h) {
      if (faults[h].text.empty()) continue;
      hits.erase(hits.begin() + static_cast<std::ptrdiff_t>(h));
      if (!measurement_.at_second_height && h < cross.size())
        cross.erase(cross.begin() + static_cast<std::ptrdiff_t>(h));
      return reject(now, faults[h]);
    }
    const int required = measurement_.hitsRequired();
    measurement_.report("hit " + std::to_string(hits.size()) + " of " + std::to_string(required),
                        measurement_.hitProgress());
    if (static_cast<int>(hits.size()) >= required || FrfEvaluation(measurement_).isPreciseEnough())
      return StepOutcome::done();
    control_.strikeAfterRest(now);
    return StepOutcome::running();
  }
};

class CollectHitsAtSecondHeight : public CollectHits {
 public:
  using CollectHits::CollectHits;

  bool isNeeded() const override { return measurement_.at_second_height; }

 private:
  StepOutcome tooManyRejected(FrfCode, const std::string& reason) override {
    measurement_.no_second_height = reason;
    return StepOutcome::hitsCompleted();
  }
};

}  // namespace

StepPtr collectHits(Measurement& measurement, StationControl& control) {
  return std::make_unique<CollectHits>(measurement, control);
}
StepPtr collectHitsAtSecondHeight(Measurement& measurement, StationControl& control) {
  return std::make_unique<CollectHitsAtSecondHeight>(measurement, control);
}

}  // namespace smartmill::hammer
