#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// xy: share of the y signal in the x channel.
class CrossTalk : public Effect {
 public:
  explicit CrossTalk(const EffectEntry& entry)
      : xy_(valueOf(entry, "xy")),
        xz_(valueOf(entry, "xz")),
        yx_(valueOf(entry, "yx")),
        yz_(valueOf(entry, "yz")),
        zx_(valueOf(entry, "zx")),
        zy_(valueOf(entry, "zy")) {}

  void measure(const Instant&, ChannelValues& c) const override {
    const double x = c[FX], y = c[FY], z = c[FZ];
    c[FX] += xy_ * y + xz_ * z;
    c[FY] += yx_ * x + yz_ * z;
    c[FZ] += zx_ * x + zy_ * y;
  }

 private:
  double xy_, xz_, yx_, yz_, zx_, zy_;  // [1]
};

const EffectClass<CrossTalk> REGISTERED("cross_talk");

}  // namespace
}  // namespace smartmill::sim
