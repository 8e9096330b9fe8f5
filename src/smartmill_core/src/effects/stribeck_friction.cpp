#include "model/effect_declaration.h"
#include "smartmill_core/cutting/friction.h"

namespace smartmill::effects {
namespace {

/// Friction that falls with speed: breakaway exp(-(n / speed)^2).
class StribeckFriction : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"stribeck_friction", EffectStage::drive, 10};
    kind.title = "additional spindle friction at low speed";
    kind.description = "adds breakaway x exp(-(n / speed)^2) to the spindle friction";
    kind.source = "Armstrong-Helouvry, Dupont & Canudas de Wit 1994";
    kind.advice = "repeat the air cuts at more speeds, low ones included";
    kind.parameters = {
        number("breakaway_nm", "N m").named("additional friction torque near standstill").drawn(0.1, 0.6),
        number("speed_rpm", "rpm", Range::positive())
            .named("speed at which 37 % of it are left")
            .drawn(1200.0, 4500.0)};
    kind.needs = {EffectNeed::load_meter};
    kind.forms = always(EffectForm({amplitude("breakaway_nm", {-20.0, 20.0, 0.000125, 0.5}),
                                    logarithm("speed_rpm", {std::log(50.0), std::log(30000.0), 2.5e-4, 1.0},
                                              1.0, std::log(1200.0))})
                            .scaled(0.05, {400.0, 1200.0, 3500.0}));
    return kind;
  }

  explicit StribeckFriction(const EffectEntry& entry)
      : breakaway_(valueOf(entry, "breakaway_nm")),
        speed_(units::radPerSecFromRpm(valueOf(entry, "speed_rpm"))) {}

  void update(const Instant& now, TwinState& state) const override {
    state.friction_extra += stribeckFriction(breakaway_, speed_, now.speed);
  }

 private:
  double breakaway_, speed_;  // [N m], [rad/s]
};

}  // namespace

EffectKind stribeckFriction() {
  return declared<StribeckFriction>();
}

}  // namespace smartmill::effects
