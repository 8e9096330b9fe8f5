#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Rotating force m e omega^2 on the sensor: x sin(a), y cos(a), a = spindle angle + angle.
class Unbalance : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"unbalance", EffectStage::sensor_force, 10};
    kind.title = "unbalance of tool and holder";
    kind.description =
        "m e omega^2 on the sensor: x sin(a), y cos(a), a = spindle angle + angle; the tip does not move";
    kind.source = "ISO 21940-11";
    kind.advice =
        "balance the tool in its holder, or stay below the speed at which the rotating force is acceptable";
    kind.parameters = {number("mass_eccentricity_g_mm", "g mm", Range::notNegative())
                           .named("unbalance, mass times distance")
                           .drawn(4.0, 20.0),
                       angle("angle_deg")};
    kind.needs = {EffectNeed::forces};
    kind.forms = always(
        EffectForm({planar("mass_eccentricity_g_mm", "angle_deg", 5000.0, 5e-4, 30.0)}).straight({1.0}));
    return kind;
  }

  explicit Unbalance(const EffectEntry& entry)
      : mass_eccentricity_(1e-6 * valueOf(entry, "mass_eccentricity_g_mm")),
        angle_(units::radFromDeg(valueOf(entry, "angle_deg"))) {}

  void addForce(const Instant& now, Axes3& force) const override {
    const double size = mass_eccentricity_ * now.speed * now.speed, a = now.angle + angle_;
    force[0] += size * std::sin(a);
    force[1] += size * std::cos(a);
  }

 private:
  double mass_eccentricity_, angle_;  // [kg m], [rad]
};

}  // namespace

EffectKind unbalance() {
  return declared<Unbalance>();
}

}  // namespace smartmill::effects
