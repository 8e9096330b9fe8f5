#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Adds to the edge coefficients.
class EdgeForces : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"edge_forces", EffectStage::cutting_law, 10};
    kind.title = "other edge force (rubbing of the edge)";
    kind.description = "adds to the edge coefficients";
    kind.source = "Dunwoody eq. 2.1; Armarego & Deshpande 1991";
    kind.advice = "compare the edge with a new one; if it is as new, use the corrected model";
    kind.parameters = {
        orZero("Kte_n_per_mm", "N/mm").named("additional tangential edge coefficient").drawn(4.0, 15.0),
        orZero("Kre_n_per_mm", "N/mm").named("additional radial edge coefficient").drawn(4.0, 15.0),
        orZero("Kae_n_per_mm", "N/mm").named("additional axial edge coefficient").drawn(0.5, 4.0)};
    kind.needs = {EffectNeed::cuts};
    kind.forms = [](const Scope& s) {
      const CuttingCoefficients k = s.nominal.cutting.value_or(CuttingCoefficients{});
      const FitRange range{0.0, 200.0, 0.005, 20.0};
      return Forms{EffectForm({addedTo(k.kte / units::N_PER_MM, "Kte_n_per_mm", range),
                               addedTo(k.kre / units::N_PER_MM, "Kre_n_per_mm", range),
                               addedTo(k.kae / units::N_PER_MM, "Kae_n_per_mm", range)})
                       .straight({2.0})};
    };
    return kind;
  }

  explicit EdgeForces(const EffectEntry& entry)
      : kte_(units::N_PER_MM * valueOf(entry, "Kte_n_per_mm")),
        kre_(units::N_PER_MM * valueOf(entry, "Kre_n_per_mm")),
        kae_(units::N_PER_MM * valueOf(entry, "Kae_n_per_mm")) {}

  void update(const Instant&, TwinState& state) const override {
    state.law.coefficients.kte += kte_;
    state.law.coefficients.kre += kre_;
    state.law.coefficients.kae += kae_;
  }
  bool scalesForce() const override { return true; }

 private:
  double kte_, kre_, kae_;  // [N/m]
};

}  // namespace

EffectKind edgeForces() {
  return declared<EdgeForces>();
}

}  // namespace smartmill::effects
