#include "model/effect_declaration.h"
#include "smartmill_core/cutting/friction.h"

namespace smartmill::effects {
namespace {

/// A cold spindle has more friction: all of it times 1 + cold exp(-start_time / constant).
class FrictionWarmup : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"friction_warmup", EffectStage::drive, 20};
    kind.title = "spindle friction that falls as the spindle warms up";
    kind.description =
        "spindle friction (Stribeck's included) multiplied by 1 + cold x exp(-start_time / constant)";
    kind.source = "Dunwoody 3.2.1: friction falls as the spindle warms up";
    kind.advice = "warm the spindle up before measuring";
    kind.parameters = {
        number("cold_ratio", "1")
            .named("additional friction of the cold spindle over that of the warm one")
            .drawn(0.2, 0.8),
        number("time_constant_s", "s", Range::positive()).named("time constant").drawn(120.0, 500.0)};
    kind.needs = {EffectNeed::load_meter, EffectNeed::start_time};
    kind.forms =
        always(EffectForm({amplitude("cold_ratio", {-0.9, 20.0, 0.000125, 0.5}),
                           logarithm("time_constant_s", {std::log(2.0), std::log(20000.0), 2.5e-4, 1.0}, 1.0,
                                     std::log(250.0))})
                   .scaled(0.05, {80.0, 250.0, 700.0}));
    return kind;
  }

  explicit FrictionWarmup(const EffectEntry& entry)
      : cold_(valueOf(entry, "cold_ratio")), constant_(valueOf(entry, "time_constant_s")) {}

  void update(const Instant& now, TwinState& state) const override {
    state.friction_factor *= warmupFactor(cold_, constant_, now.start_time);
  }

 private:
  double cold_, constant_;  // [1], [s]
};

}  // namespace

EffectKind frictionWarmup() {
  return declared<FrictionWarmup>();
}

}  // namespace smartmill::effects
