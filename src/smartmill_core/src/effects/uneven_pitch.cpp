#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

void drawPitches(const MachineModel& machine, EffectKind::Random& random, EffectEntry& entry) {
  std::vector<double>& pitch = entry.lists["pitch_deg"];
  double rest = 360.0;
  for (int k = 0; k + 1 < machine.tool->teeth; ++k) {
    pitch.push_back(360.0 / machine.tool->teeth + eitherSign(random, 1.0, 5.0));
    rest -= pitch.back();
  }
  pitch.push_back(rest);
}

/// Unevenly spaced teeth; the feed of each tooth is in proportion to its pitch.
class UnevenPitch : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"uneven_pitch", EffectStage::geometry, 10};
    kind.title = "unevenly spaced teeth";
    kind.description = "teeth not evenly spaced; the feed of each tooth is in proportion to its pitch";
    kind.source = "Budak 2003";
    kind.advice = "state the measured pitch of the teeth in the model";
    kind.parameters = {
        perTooth("pitch_deg", "deg", Range::positive(), 360.0).named("angle to the next tooth")};
    kind.needs = {EffectNeed::cuts, EffectNeed::several_teeth};
    kind.forms = [](const Scope& s) {
      return Forms{
          EffectForm({pitches("pitch_deg", *s.nominal.tool, {-30.0, 30.0, 5e-4, 5.0})}).straight({0.5})};
    };
    kind.draw = drawPitches;
    return kind;
  }

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

}  // namespace

EffectKind unevenPitch() {
  return declared<UnevenPitch>();
}

}  // namespace smartmill::effects
