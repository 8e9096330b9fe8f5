#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// The charge amplifier drifts linearly from the start of each record.
class ChargeDrift : public Effect {
 public:
  explicit ChargeDrift(const EffectEntry& entry)
      : rate_(valueOf(entry, "rate_n_per_min") / 60.0), y_ratio_(valueOf(entry, "y_ratio")) {}

  void measure(const Instant& now, ChannelValues& c) const override {
    c[FX] += rate_ * now.record_time;
    c[FY] += y_ratio_ * rate_ * now.record_time;
  }

 private:
  double rate_, y_ratio_;  // [N/s], [1]
};

const EffectClass<ChargeDrift> REGISTERED("charge_drift");

}  // namespace
}  // namespace smartmill::sim
