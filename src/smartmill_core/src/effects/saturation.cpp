#include <algorithm>

#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// The amplifier clips fx, fy and fz.
class Saturation : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"saturation", EffectStage::signal, 40};
    kind.title = "clipped force signals";
    kind.description = "fx, fy and fz clipped at plus and minus the limit";
    kind.source = "range of the charge amplifier";
    kind.advice = "increase the range of the amplifier and repeat the cuts";
    kind.parameters = {number("limit_n", "N", Range::positive())
                           .named("force at which the signal is clipped")
                           .drawn(150.0, 350.0)};
    kind.needs = {EffectNeed::forces};
    kind.forms = [](const Scope& s) {
      const double most = s.largest_force;
      return Forms{
          EffectForm({amplitude("limit_n", {0.02 * most, 8.0 * most, 1e-5 * most, 4.0 * most}, 4.0 * most)})
              .startingAt({0.99 * most})
              .startingAt({0.97 * most})};
    };
    return kind;
  }

  explicit Saturation(const EffectEntry& entry) : limit_(valueOf(entry, "limit_n")) {}

  void measure(const Instant&, ChannelValues& c) const override {
    for (const std::size_t f : {FX, FY, FZ}) c[f] = std::clamp(c[f], -limit_, limit_);
  }
  void applyLimit(ChannelValues& c) const override {
    for (const std::size_t f : {FX, FY, FZ}) c[f] = std::min(c[f], limit_);
  }

 private:
  double limit_;  // [N]
};

}  // namespace

EffectKind saturation() {
  return declared<Saturation>();
}

}  // namespace smartmill::effects
