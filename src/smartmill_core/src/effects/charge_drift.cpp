#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Linear drift of the charge amplifiers from the start of each record.
class ChargeDrift : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"charge_drift", EffectStage::signal, 20};
    kind.title = "drift of the charge amplifier";
    kind.description = "linear drift from the start of each record: rate on fx, y_ratio of it on fy";
    kind.source = "Kistler, charge amplifiers: drift of the insulation";
    kind.advice = "check the insulation of cables and connectors, and reset the amplifier before each record";
    kind.parameters = {
        number("rate_n_per_min", "N/min").named("drift of fx").drawnOnBothSides(800.0, 4000.0),
        number("y_ratio", "1").named("drift of fy over that of fx").drawnOnBothSides(0.3, 1.5)};
    kind.needs = {EffectNeed::forces};
    // Both points have a drift on x: without it the ratio is undefined.
    kind.forms = always(EffectForm({sizes("rate_n_per_min", "y_ratio", {-1e5, 1e5, 0.025, 500.0})})
                            .probe({0.0, 0.0}, {{20.0, 0.0}, {20.0, 20.0}}));
    return kind;
  }

  explicit ChargeDrift(const EffectEntry& entry)
      : rate_(valueOf(entry, "rate_n_per_min") / 60.0), y_ratio_(valueOf(entry, "y_ratio")) {}

  void measure(const Instant& now, ChannelValues& c) const override {
    c[FX] += rate_ * now.record_time;
    c[FY] += y_ratio_ * rate_ * now.record_time;
  }

 private:
  double rate_, y_ratio_;  // [N/s], [1]
};

}  // namespace

EffectKind chargeDrift() {
  return declared<ChargeDrift>();
}

}  // namespace smartmill::effects
