#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// The charge amplifier's zero: a constant on each force channel.
class ZeroOffset : public Effect {
 public:
  explicit ZeroOffset(const EffectEntry& entry)
      : x_(valueOf(entry, "x_n")), y_(valueOf(entry, "y_n")), z_(valueOf(entry, "z_n")) {}

  void measure(const Instant&, ChannelValues& c) const override {
    c[FX] += x_;
    c[FY] += y_;
    c[FZ] += z_;
  }

 private:
  double x_, y_, z_;  // [N]
};

const EffectClass<ZeroOffset> REGISTERED("zero_offset");

}  // namespace
}  // namespace smartmill::sim
