#include <algorithm>

#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

// The gain is bounded by the direct share, which may be uncertain in the nominal model.
Forms modeForms(const Scope& scope) {
  Forms forms;
  for (std::size_t a = 0; a < axisNames().size(); ++a) {
    const std::string& axis = axisNames()[a];
    if (scope.channels.count("f" + axis) == 0) continue;
    const double most = std::max(scope.nominal.force_sensor.axis[a].direct, 0.2);
    const EffectForm mode =
        EffectForm(
            {logarithm("frequency_hz", {std::log(20.0), std::log(12000.0), 2.5e-06, 1.5}, 1.0,
                       std::log(800.0)),
             logarithm("damping_ratio", {std::log(0.001), std::log(0.6), 0.00025, 1.0}, 1.0, std::log(0.03)),
             amplitude("gain", {-most, most, 2.5e-05, 0.2})})
            .word("axis", axis)
            .searchedBy(EffectForm::SearchStrategy::sensor_mode);
    forms.push_back(EffectForm(mode).named(axis));
    forms.push_back(EffectForm(mode).named(axis + ", second").onlyAfter(axis));
  }
  return forms;
}

/// A further mode of the force sensor. Its gain is taken from the direct share, so that the static gain
/// stays 1.
class ExtraMode : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"extra_mode", EffectStage::sensor, 30};
    kind.title = "resonance of the force sensor or its clamping";
    kind.description = "one more mode in the force sensor; its gain is taken from the direct share";
    kind.source = "Dunwoody eq. 5.5";
    kind.advice = "check how sensor and workpiece are clamped, and repeat the taps on the workpiece";
    kind.parameters = {oneOf("axis", axisNames()),
                       number("frequency_hz", "Hz", Range::positive()).drawn(300.0, 3500.0),
                       number("damping_ratio", "1", Range::open(0.0, 1.0)).drawn(0.01, 0.05),
                       number("gain", "1").named("share of the force that excites it").drawn(0.03, 0.09)};
    kind.needs = {EffectNeed::forces};
    kind.forms = modeForms;
    return kind;
  }

  explicit ExtraMode(const EffectEntry& entry) : axis_(channelOf("f" + wordOf(entry, "axis"))) {
    mode_.frequency = valueOf(entry, "frequency_hz");
    mode_.damping_ratio = valueOf(entry, "damping_ratio");
    mode_.gain = valueOf(entry, "gain");
  }

  void setUp(TwinSetup& setup) const override {
    ModalModel& axis = setup.model.force_sensor.axis[axis_];
    axis.modes.push_back(mode_);
    axis.direct -= mode_.gain;
  }

 private:
  std::size_t axis_;
  Mode mode_;
};

}  // namespace

EffectKind extraMode() {
  return declared<ExtraMode>();
}

}  // namespace smartmill::effects
