#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Teeth that are not evenly spaced; each tooth takes its pitch's share of the feed.
class UnevenPitch : public Effect {
 public:
  explicit UnevenPitch(const EffectEntry& entry) {
    for (const double p : listOf(entry, "pitch_deg")) pitch_.push_back(units::radFromDeg(p));
  }

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool) return;
    checkTeeth("uneven_pitch", pitch_.size(), *setup.model.tool);
    setup.model.tool->pitch = pitch_;
  }

 private:
  std::vector<double> pitch_;  // [rad]
};

const EffectClass<UnevenPitch> REGISTERED("uneven_pitch");

}  // namespace
}  // namespace smartmill::sim
