#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Adds to the chip coefficients.
class ChipCoefficients : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"chip_coefficients", EffectStage::cutting_law, 40};
    kind.title = "other cutting force of the material";
    kind.description = "adds to the chip coefficients";
    kind.source = "Dunwoody eq. 2.1: coefficients of another material, or of a regression biased by runout";
    kind.advice = "check material and hardness; if they are those of the model, use the corrected model";
    kind.parameters = {orZero("Ktc_n_per_mm2", "N/mm2")
                           .named("additional tangential chip coefficient")
                           .drawnOnBothSides(120.0, 300.0),
                       orZero("Krc_n_per_mm2", "N/mm2")
                           .named("additional radial chip coefficient")
                           .drawnOnBothSides(50.0, 110.0),
                       orZero("Kac_n_per_mm2", "N/mm2")
                           .named("additional axial chip coefficient")
                           .drawnOnBothSides(30.0, 90.0)};
    kind.needs = {EffectNeed::cuts};
    kind.forms = [](const Scope& s) {
      const CuttingCoefficients k = s.nominal.cutting.value_or(CuttingCoefficients{});
      return Forms{
          EffectForm({addedTo(k.ktc / units::N_PER_MM2, "Ktc_n_per_mm2", {0.0, 4000.0, 0.05, 300.0}),
                      addedTo(k.krc / units::N_PER_MM2, "Krc_n_per_mm2", {0.0, 3000.0, 0.05, 200.0}),
                      addedTo(k.kac / units::N_PER_MM2, "Kac_n_per_mm2", {0.0, 3000.0, 0.05, 200.0})})
              .straight({10.0})};
    };
    return kind;
  }

  explicit ChipCoefficients(const EffectEntry& entry)
      : ktc_(units::N_PER_MM2 * valueOf(entry, "Ktc_n_per_mm2")),
        krc_(units::N_PER_MM2 * valueOf(entry, "Krc_n_per_mm2")),
        kac_(units::N_PER_MM2 * valueOf(entry, "Kac_n_per_mm2")) {}

  void update(const Instant&, TwinState& state) const override {
    state.law.coefficients.ktc += ktc_;
    state.law.coefficients.krc += krc_;
    state.law.coefficients.kac += kac_;
  }
  bool scalesForce() const override { return true; }

 private:
  double ktc_, krc_, kac_;  // [N/m2]
};

}  // namespace

EffectKind chipCoefficients() {
  return declared<ChipCoefficients>();
}

}  // namespace smartmill::effects
