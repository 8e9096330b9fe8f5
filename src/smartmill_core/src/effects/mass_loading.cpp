#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Added mass on the sensor: the first mode of each axis falls by 1/sqrt(1 + ratio), its damping ratio is
/// unchanged.
class MassLoading : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"mass_loading", EffectStage::sensor, 10};
    kind.title = "heavier or lighter workpiece on the force sensor";
    kind.description =
        "the first sensor mode of each axis falls by 1/sqrt(1 + ratio), damping ratio unchanged";
    kind.source = "Dunwoody 5.2: workpiece mass on the dynamometer";
    kind.advice = "repeat the taps with the present workpiece";
    kind.parameters = {number("mass_ratio", "1", Range::above(-1.0))
                           .named("additional mass over the moving mass of the sensor")
                           .drawn(0.08, 0.4)};
    kind.needs = {EffectNeed::forces, EffectNeed::sensor_modes};
    // In the logarithm the mass acts exactly as the modes' stated frequencies do, all at once. The response
    // of a lightly damped mode is proportional only while it moves by less than its width.
    kind.forms =
        always(EffectForm({logarithmOfOnePlus("mass_ratio", {std::log(0.4), std::log(4.0), 5e-05, 0.3})})
                   .straight({0.01, 0.05, 0.12, 0.2, 0.3, 0.45, 0.7, -0.05, -0.12, -0.25}));
    return kind;
  }

  explicit MassLoading(const EffectEntry& entry) : ratio_(valueOf(entry, "mass_ratio")) {}

  void setUp(TwinSetup& setup) const override {
    for (ModalModel& axis : setup.model.force_sensor.axis) {
      if (!axis.modes.empty()) axis.modes.front().frequency /= std::sqrt(1.0 + ratio_);
    }
  }

 private:
  double ratio_;  // [1] added over modal mass
};

}  // namespace

EffectKind massLoading() {
  return declared<MassLoading>();
}

}  // namespace smartmill::effects
