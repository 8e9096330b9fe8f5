#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Spindle and tool grow while they warm up: the cut is deeper by growth (1 - exp(-start_time / constant)).
class ThermalGrowth : public Effect {
 public:
  explicit ThermalGrowth(const EffectEntry& entry)
      : growth_(units::UM * valueOf(entry, "growth_um")), constant_(valueOf(entry, "time_constant_s")) {}

  void update(const Instant& now, TwinState& state) const override {
    state.depth_extra -= growth_ * std::expm1(-now.start_time / constant_);
  }

 private:
  double growth_, constant_;  // [m], [s]
};

const EffectClass<ThermalGrowth> REGISTERED("thermal_growth");

}  // namespace
}  // namespace smartmill::sim
