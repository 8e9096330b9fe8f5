#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

constexpr std::array<const char*, 6> PAIRS{{"xy", "xz", "yx", "yz", "zx", "zy"}};

void drawSomePairs(const MachineModel&, EffectKind::Random& random, EffectEntry& entry) {
  for (auto& [pair, share] : entry.numbers) {
    if (std::bernoulli_distribution(0.5)(random)) share = 0.0;
  }
  if (entry.numbers["xz"] == 0.0 && entry.numbers["yx"] == 0.0)
    entry.numbers["xy"] = eitherSign(random, 0.02, 0.08);
}

/// Cross talk between the force channels. xy: share of the y signal in the x channel.
class CrossTalk : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"cross_talk", EffectStage::sensor_output, 10};
    kind.title = "cross-talk of the force channels";
    kind.description = "xy: share of the y signal in the x channel, the others alike";
    kind.source = "Kistler, data sheets of multi-component dynamometers";
    kind.advice = "calibrate the force sensor with its cross-talk (kalman/calibrate)";
    for (const char* pair : PAIRS) {
      kind.parameters.push_back(orZero(pair, "1").drawnOnBothSides(0.02, 0.08));
      kind.parameters.back().name = std::string("share of f") + pair[1] + " in f" + pair[0];
    }
    kind.needs = {EffectNeed::forces};
    kind.forms = [](const Scope&) {
      std::vector<EffectCoordinates> shares;
      for (const char* pair : PAIRS) shares.push_back(amplitude(pair, {-0.9, 0.9, 0.002, 0.1}));
      return Forms{EffectForm(shares).straight({0.01})};
    };
    kind.draw = drawSomePairs;
    return kind;
  }

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

}  // namespace

EffectKind crossTalk() {
  return declared<CrossTalk>();
}

}  // namespace smartmill::effects
