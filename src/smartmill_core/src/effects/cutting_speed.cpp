#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Kc times (v / reference)^(-exponent), v the speed of the edge; edge coefficients are unchanged.
class CuttingSpeed : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"cutting_speed", EffectStage::cutting_law, 30};
    kind.title = "cutting force that changes with the cutting speed";
    kind.description = "Kc multiplied by (v / reference)^-exponent";
    kind.source = "Altintas, Manufacturing Automation, 2.4";
    kind.advice = "use the corrected model: it contains the dependence on the cutting speed";
    kind.parameters = {number("exponent", "1").named("exponent of the cutting speed").drawn(0.05, 0.25),
                       number("reference_m_per_min", "m/min", Range::positive())
                           .named("cutting speed with the force of the supplied model")
                           .drawn(100.0, 300.0)};
    kind.needs = {EffectNeed::cuts};
    // A level without a slope cannot be written: every point has some slope.
    kind.forms = always(EffectForm({powerLaw("exponent", "reference_m_per_min", 150.0, 1.0, 5000.0)})
                            .probe({0.0, 0.0}, {{0.02, 0.0}, {0.02, 0.01}}));
    return kind;
  }

  explicit CuttingSpeed(const EffectEntry& entry)
      : exponent_(valueOf(entry, "exponent")),
        reference_(units::M_PER_MIN * valueOf(entry, "reference_m_per_min")) {}

  void update(const Instant& now, TwinState& state) const override {
    const double v = now.speed * state.radius;
    if (v > 0.0) state.law.chip_factor *= std::pow(v / reference_, -exponent_);
  }
  bool scalesForce() const override { return true; }

 private:
  double exponent_, reference_;  // [1], [m/s]
};

}  // namespace

EffectKind cuttingSpeed() {
  return declared<CuttingSpeed>();
}

}  // namespace smartmill::effects
