#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// A cold spindle turns harder: all of its friction times 1 + cold exp(-start_time / constant).
class FrictionWarmup : public Effect {
 public:
  explicit FrictionWarmup(const EffectEntry& entry)
      : cold_(valueOf(entry, "cold_ratio")), constant_(valueOf(entry, "time_constant_s")) {}

  void update(const Instant& now, TwinState& state) const override {
    state.friction_factor *= 1.0 + cold_ * std::exp(-now.start_time / constant_);
  }

 private:
  double cold_, constant_;  // [1], [s]
};

const EffectClass<FrictionWarmup> REGISTERED("friction_warmup");

}  // namespace
}  // namespace smartmill::sim
