#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

void drawModes(const MachineModel&, EffectKind::Random& random, EffectEntry& entry) {
  for (ModalModel* axis : {&entry.flexibility.x, &entry.flexibility.y}) {
    Mode mode;
    mode.frequency = between(random, 800.0, 2200.0);
    mode.damping_ratio = between(random, 0.03, 0.06);
    mode.gain = 1.0 / (units::N_PER_UM * between(random, 25.0, 50.0));
    axis->modes = {mode};
  }
}

/// Further modes of the tool tip: the tip vibrates and the chip regenerates.
class ToolFlexibility : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"tool_flexibility", EffectStage::structure, 10};
    kind.title = "vibrating tool (a resonance is missing)";
    kind.description = "modes added to the tool tip's: it vibrates and the chip regenerates";
    kind.source = "Dunwoody 2.2; Altintas & Budak 1995";
    kind.advice = "measure the FRF of the tool tip with the hammer";
    kind.parameters = {modes("x"), modes("y")};
    kind.needs = {EffectNeed::cuts};
    kind.forms = [](const Scope&) {
      constexpr auto BY_MODE = EffectForm::SearchStrategy::tip_mode;
      return Forms{EffectForm({tipMode('x')}).named("x").of({"x"}).searchedBy(BY_MODE),
                   EffectForm({tipMode('y')}).named("y").of({"y"}).searchedBy(BY_MODE),
                   EffectForm({tipMode('x'), tipMode('y')}).named("xy").of({"x", "y"}).searchedBy(BY_MODE)};
    };
    kind.draw = drawModes;
    return kind;
  }

  explicit ToolFlexibility(const EffectEntry& entry) : modes_(entry.flexibility) {}

  void setUp(TwinSetup& setup) const override {
    ToolTip& tip = setup.model.tool_tip;
    tip.x.modes.insert(tip.x.modes.end(), modes_.x.modes.begin(), modes_.x.modes.end());
    tip.y.modes.insert(tip.y.modes.end(), modes_.y.modes.begin(), modes_.y.modes.end());
  }

 private:
  ToolTip modes_;
};

}  // namespace

EffectKind toolFlexibility() {
  return declared<ToolFlexibility>();
}

}  // namespace smartmill::effects
