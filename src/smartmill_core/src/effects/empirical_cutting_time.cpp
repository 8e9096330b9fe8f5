#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Chip coefficients times 1 + amplitude exp(-t / constant), t since this cut began.
class CuttingTime : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("law", "cutting_time", EffectStage::cutting_law, 20);
    kind.description = "chip coefficients times 1 + amplitude exp(-t / constant), t since this cut began";
    kind.source = "exponential approach";
    kind.parameters = {number("amplitude", "1", Range::above(-1.0)),
                       number("time_constant_s", "s", Range::positive())};
    kind.needs = {EffectNeed::cuts};
    kind.forms = always(EffectForm({amplitude("amplitude", {-0.9, 3.0, 1e-4, 0.3}),
                                    logarithm("time_constant_s", {std::log(2e-3), std::log(5.0), 1e-3, 1.0},
                                              1.0, std::log(0.05))})
                            .scaled(0.05, {0.01, 0.03, 0.07, 0.2}));
    return kind;
  }

  explicit CuttingTime(const EffectEntry& entry)
      : amplitude_(valueOf(entry, "amplitude")), constant_(valueOf(entry, "time_constant_s")) {}

  void update(const Instant& now, TwinState& state) const override {
    state.law.chip_factor *= 1.0 + amplitude_ * std::exp(-now.cut.time / constant_);
  }

 private:
  double amplitude_, constant_;  // [1], [s]
};

}  // namespace

EffectKind empiricalCuttingTime() {
  return declared<CuttingTime>();
}

}  // namespace smartmill::effects
