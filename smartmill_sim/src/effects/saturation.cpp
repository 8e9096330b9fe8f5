#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// The amplifier clips fx, fy and fz.
class Saturation : public Effect {
 public:
  explicit Saturation(const EffectEntry& entry) : limit_(valueOf(entry, "limit_n")) {}

  void measure(const Instant&, ChannelValues& c) const override {
    for (const std::size_t f : {FX, FY, FZ}) c[f] = std::clamp(c[f], -limit_, limit_);
  }
  void limit(ChannelValues& c) const override {
    for (const std::size_t f : {FX, FY, FZ}) c[f] = std::min(c[f], limit_);
  }

 private:
  double limit_;  // [N]
};

const EffectClass<Saturation> REGISTERED("saturation");

}  // namespace
}  // namespace smartmill::sim
