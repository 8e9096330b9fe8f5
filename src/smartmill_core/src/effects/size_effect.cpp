#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Size effect: Kc times (h / reference)^(-exponent); edge coefficients are unchanged.
class SizeEffect : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"size_effect", EffectStage::cutting_law, 20};
    kind.title = "more force per chip area at thin chips";
    kind.description = "Kc multiplied by (h / reference)^-exponent";
    kind.source = "Kienzle 1952";
    kind.advice = "use the corrected model: thin chips need more force per area than the supplied one states";
    kind.parameters = {number("exponent", "1").named("exponent of the chip thickness").drawn(0.1, 0.35),
                       number("reference_chip_um", "um", Range::positive())
                           .named("chip thickness with the force of the supplied model")
                           .drawn(40.0, 120.0)};
    kind.needs = {EffectNeed::cuts};
    // A level without a slope cannot be written: every point has some slope.
    kind.forms = always(EffectForm({powerLaw("exponent", "reference_chip_um", 60.0, 1.0, 3000.0)})
                            .probe({0.0, 0.0}, {{0.02, 0.0}, {0.02, 0.01}}));
    return kind;
  }

  explicit SizeEffect(const EffectEntry& entry)
      : exponent_(valueOf(entry, "exponent")), reference_(units::UM * valueOf(entry, "reference_chip_um")) {}

  void update(const Instant&, TwinState& state) const override {
    state.law.size_exponent = exponent_;
    state.law.size_reference = reference_;
  }

 private:
  double exponent_, reference_;  // [1], [m]
};

}  // namespace

EffectKind sizeEffect() {
  return declared<SizeEffect>();
}

}  // namespace smartmill::effects
