#include "effect_class.h"
#include "smartmill_core/cutting/friction.h"

namespace smartmill::sim {
namespace {

/// Friction that fades with speed: breakaway exp(-(n / speed)^2).
class StribeckFriction : public Effect {
 public:
  explicit StribeckFriction(const EffectEntry& entry)
      : breakaway_(valueOf(entry, "breakaway_nm")),
        speed_(units::radPerSecFromRpm(valueOf(entry, "speed_rpm"))) {}

  void update(const Instant& now, TwinState& state) const override {
    state.friction_extra += stribeckFriction(breakaway_, speed_, now.speed);
  }

 private:
  double breakaway_, speed_;  // [N m], [rad/s]
};

const EffectClass<StribeckFriction> REGISTERED("stribeck_friction");

}  // namespace
}  // namespace smartmill::sim
