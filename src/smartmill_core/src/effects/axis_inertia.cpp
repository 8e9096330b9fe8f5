#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Inertia of the mass that an axis moves together with the force sensor: minus mass times acceleration.
class AxisInertia : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"axis_inertia", EffectStage::sensor_force, 30};
    kind.title = "moving mass on the force sensor";
    kind.description =
        "the sensor moves with an axis: minus mass x acceleration of the axis acts on it along the axis";
    kind.source = "d'Alembert's force of table, sensor and workpiece";
    kind.advice = "use the corrected model, or records at constant feed only";
    kind.parameters = {oneOf("axis", axisNames()),
                       number("mass_kg", "kg", Range::notNegative()).named("moving mass").drawn(5.0, 60.0)};
    kind.needs = {EffectNeed::forces, EffectNeed::axis_motion};
    kind.forms = [](const Scope& s) {
      Forms forms;
      for (const std::string& axis : s.axes) {
        if (s.channels.count("f" + axis) == 0) continue;
        forms.push_back(EffectForm({amplitude("mass_kg", {0.0, 5000.0, 0.005, 100.0})})
                            .straight({1.0})
                            .word("axis", axis)
                            .named(axis));
      }
      return forms;
    };
    return kind;
  }

  explicit AxisInertia(const EffectEntry& entry)
      : axis_(channelOf("f" + wordOf(entry, "axis"))), mass_(valueOf(entry, "mass_kg")) {}

  void addForce(const Instant& now, Axes3& force) const override {
    force[axis_] -= mass_ * now.axis_acceleration[axis_];
  }

 private:
  std::size_t axis_;
  double mass_;  // [kg]
};

}  // namespace

EffectKind axisInertia() {
  return declared<AxisInertia>();
}

}  // namespace smartmill::effects
