#include <algorithm>

#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// The first sensor mode of each axis falls linearly with the spindle speed.
class SpeedDependentMode : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"speed_dependent_mode", EffectStage::sensor, 20};
    kind.title = "resonance of the force sensor that falls with the speed";
    kind.description = "the first sensor mode of each axis falls linearly with spindle speed";
    kind.source = "Cao & Altintas 2007: bearing preload falls with speed";
    kind.advice =
        "measure the FRF of the force sensor from cuts at the speeds in use (smartmill cutting-frf)";
    kind.parameters = {number("softening_per_krpm", "1/krpm")
                           .named("relative fall of the frequency per 1000 rpm")
                           .drawn(0.004, 0.015)};
    kind.needs = {EffectNeed::forces, EffectNeed::sensor_modes};
    kind.forms = always(EffectForm({amplitude("softening_per_krpm", {-0.04, 0.04, 5e-06, 0.02})})
                            .straight({0.001, 0.003, 0.006, 0.01, 0.015, 0.025, -0.003, -0.01}));
    return kind;
  }

  explicit SpeedDependentMode(const EffectEntry& entry) : softening_(valueOf(entry, "softening_per_krpm")) {}

  void update(const Instant& now, TwinState& state) const override {
    constexpr double LEAST = 0.05;  // keeps the frequency positive
    const double factor = 1.0 - softening_ * 1e-3 * units::rpmFromRadPerSec(now.speed);
    state.sensor_frequency *= std::max(factor, LEAST);
  }

 private:
  double softening_;  // [1] per 1000 rpm
};

}  // namespace

EffectKind speedDependentMode() {
  return declared<SpeedDependentMode>();
}

}  // namespace smartmill::effects
