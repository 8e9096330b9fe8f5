#include "classes.h"

namespace smartmill::sim {
namespace {

/// Teeth that are not evenly spaced; each tooth takes its pitch's share of the feed.
class UnevenPitch : public Effect {
 public:
  explicit UnevenPitch(const EffectEntry& entry) {
    for (const double p : entry.pitch_deg) pitch_.push_back(units::radFromDeg(p));
    if (pitch_.empty()) throw Error("pitch_deg is missing");
  }

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool) return;
    if (pitch_.size() != static_cast<std::size_t>(setup.model.tool->teeth))
      throw Error("uneven_pitch: " + std::to_string(pitch_.size()) + " pitches for " +
                  std::to_string(setup.model.tool->teeth) + " teeth");
    setup.model.tool->pitch = pitch_;
  }

 private:
  std::vector<double> pitch_;  // [rad]
};

}  // namespace

EffectPtr makeUnevenPitch(const EffectEntry& entry) {
  return std::make_unique<UnevenPitch>(entry);
}

}  // namespace smartmill::sim
