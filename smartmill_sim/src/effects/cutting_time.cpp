#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: the chip coefficients times 1 + amplitude exp(-t / constant), t since this cut began.
class CuttingTime : public Effect {
 public:
  explicit CuttingTime(const EffectEntry& entry)
      : amplitude_(valueOf(entry, "amplitude")), constant_(valueOf(entry, "time_constant_s")) {}

  void update(const Instant& now, TwinState& state) const override {
    state.law.chip_factor *= 1.0 + amplitude_ * std::exp(-now.cut_time / constant_);
  }

 private:
  double amplitude_, constant_;  // [1], [s]
};

const EffectClass<CuttingTime> REGISTERED("empirical:cutting_time");

}  // namespace
}  // namespace smartmill::sim
