#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// A helix angle that differs from the nominal one.
class Helix : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"helix", EffectStage::geometry, 40};
    kind.title = "other helix angle of the tool";
    kind.description = "helix angle, replaces the nominal one";
    kind.source = "Dunwoody eq. 5.64";
    kind.advice = "measure the helix angle and state it in the model";
    kind.parameters = {number("helix_deg", "deg", Range::openHigh(0.0, 80.0)).named("helix angle")};
    kind.needs = {EffectNeed::cuts};
    kind.forms = [](const Scope& s) {
      const double helix = units::degFromRad(s.nominal.tool->helix);
      return Forms{EffectForm({amplitude("helix_deg", {0.0, 75.0, 0.0025, 8.0}, helix)})
                       .straight({helix > 60.0 ? -1.0 : 1.0})};
    };
    kind.draw = [](const MachineModel& machine, EffectKind::Random& random, EffectEntry& entry) {
      entry.numbers["helix_deg"] = units::degFromRad(machine.tool->helix) + eitherSign(random, 3.0, 9.0);
    };
    return kind;
  }

  explicit Helix(const EffectEntry& entry) : helix_(units::radFromDeg(valueOf(entry, "helix_deg"))) {}

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool) return;
    setup.model.tool->helix = helix_;
    setup.model.tool->edge.helix.clear();
  }

 private:
  double helix_;  // [rad]
};

}  // namespace

EffectKind helix() {
  return declared<Helix>();
}

}  // namespace smartmill::effects
