#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

constexpr std::array<const char*, 3> KEYS{{"x_n", "y_n", "z_n"}};

/// Zero error of the charge amplifiers: a constant on each force channel.
class ZeroOffset : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"zero_offset", EffectStage::signal, 10};
    kind.title = "wrong zero of the force channels";
    kind.description = "a constant on each force channel";
    kind.source = "Kistler, charge amplifiers: zero after the last reset";
    kind.advice = "zero the amplifier before each record";
    for (const char* key : KEYS) {
      kind.parameters.push_back(orZero(key, "N").drawnOnBothSides(2.0, 15.0));
      kind.parameters.back().name = std::string("zero of f") + key[0];
    }
    kind.needs = {EffectNeed::forces};
    std::vector<EffectCoordinates> offsets;
    for (const char* key : KEYS) offsets.push_back(amplitude(key, {-2000.0, 2000.0, 5e-4, 30.0}));
    kind.forms = always(EffectForm(offsets).straight({1.0}));
    return kind;
  }

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

}  // namespace

EffectKind zeroOffset() {
  return declared<ZeroOffset>();
}

}  // namespace smartmill::effects
