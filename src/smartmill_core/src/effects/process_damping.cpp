#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Contact of the flank with the wavy surface: radial force C v_r / v_c per length of engaged edge, v_r the
/// velocity into the work; the tangential force is 0.3 of it.
class ProcessDamping : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"process_damping", EffectStage::cutting_law, 70};
    kind.title = "vibration damped by the edge at low speed";
    kind.description =
        "radial force C v_r / v_c per mm of engaged edge, v_r the velocity into the work; tangential 0.3 of "
        "it";
    kind.source = "Tunc & Budak 2012; Altintas, Eynian & Onozuka 2008";
    kind.advice =
        "use the corrected model: at low speeds deeper cuts are stable than the supplied one predicts";
    kind.parameters = {number("coefficient_n_per_mm", "N/mm")
                           .named("damping force at a velocity into the work equal to the cutting speed")
                           .drawn(150.0, 800.0)};
    kind.needs = {EffectNeed::cuts, EffectNeed::flexible_tool};
    kind.forms = always(EffectForm({amplitude("coefficient_n_per_mm", {-1e4, 1e6, 0.125, 2000.0})})
                            .straight({50.0, 300.0, 1500.0}));
    return kind;
  }

  explicit ProcessDamping(const EffectEntry& entry)
      : coefficient_(units::N_PER_MM * valueOf(entry, "coefficient_n_per_mm")) {}

  void update(const Instant&, TwinState& state) const override { state.law.damping += coefficient_; }

 private:
  double coefficient_;  // [N/m]
};

}  // namespace

EffectKind processDamping() {
  return declared<ProcessDamping>();
}

}  // namespace smartmill::effects
