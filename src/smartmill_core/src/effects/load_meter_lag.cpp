#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Bandwidth of the load meter, in place of the nominal one.
class LoadMeterLag : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"load_meter_lag", EffectStage::drive, 30};
    kind.title = "load meter slower or faster than stated";
    kind.description = "bandwidth of the load meter, replaces the nominal one";
    kind.source = "Dunwoody 3.2.1: first-order load meter";
    kind.advice = "state the bandwidth of the load meter in the model";
    kind.parameters = {
        number("bandwidth_hz", "Hz", Range::positive()).named("bandwidth of the load meter").drawn(1.5, 5.0)};
    kind.needs = {EffectNeed::load_meter};
    kind.forms = [](const Scope& s) {
      return Forms{EffectForm({logarithm("bandwidth_hz", {std::log(0.01), std::log(20.0), 0.000125, 0.7},
                                         s.nominal.spindle->load_meter_bandwidth)})
                       .straight({-0.1, -0.5, -1.2, 0.4})};
    };
    return kind;
  }

  explicit LoadMeterLag(const EffectEntry& entry) : bandwidth_(valueOf(entry, "bandwidth_hz")) {}

  void setUp(TwinSetup& setup) const override {
    if (setup.model.spindle) setup.model.spindle->load_meter_bandwidth = bandwidth_;
  }

 private:
  double bandwidth_;  // [Hz]
};

}  // namespace

EffectKind loadMeterLag() {
  return declared<LoadMeterLag>();
}

}  // namespace smartmill::effects
