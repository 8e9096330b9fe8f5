#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

// Probes at several time constants, in units of the time before the first cut.
Forms growthForms(const Scope& scope) {
  EffectForm form(
      {saturating("growth_um", "time_constant_s", scope.first_cut, {-2000.0, 2000.0, 0.0125, 50.0})});
  for (const double constants : {0.2, 0.6, 1.75}) {
    const double share = std::exp(-1.0 / constants);
    form.probe({0.0, share}, {{10.0, share}});
  }
  return {form};
}

/// Spindle and tool grow as they warm up: the cut is deeper by growth (1 - exp(-start_time / constant)).
class ThermalGrowth : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"thermal_growth", EffectStage::motion, 30};
    kind.title = "spindle and tool that grow as they warm up";
    kind.description = "the axial depth of a cut grows by growth x (1 - exp(-start_time / constant))";
    kind.source = "Ramesh, Mannan & Poo 2000: spindle and tool grow as they warm up";
    kind.advice = "warm the machine up, and measure the length of the tool again";
    kind.parameters = {number("growth_um", "um").named("growth when warm").drawn(30.0, 120.0),
                       number("time_constant_s", "s", Range::positive()).drawn(120.0, 500.0)};
    kind.needs = {EffectNeed::cuts, EffectNeed::start_time};
    kind.forms = growthForms;
    return kind;
  }

  explicit ThermalGrowth(const EffectEntry& entry)
      : growth_(units::UM * valueOf(entry, "growth_um")), constant_(valueOf(entry, "time_constant_s")) {}

  void update(const Instant& now, TwinState& state) const override {
    state.depth_extra -= growth_ * std::expm1(-now.start_time / constant_);
  }

 private:
  double growth_, constant_;  // [m], [s]
};

}  // namespace

EffectKind thermalGrowth() {
  return declared<ThermalGrowth>();
}

}  // namespace smartmill::effects
