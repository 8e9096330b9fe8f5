#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Force on the sensor that is locked to the spindle angle: x_n sin(order x spindle angle + x_deg), likewise
/// for y and z.
class SpindleOrder : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"spindle_order", EffectStage::sensor_force, 20};
    kind.title = "force locked to the spindle angle";
    kind.description =
        "x_n sin(order x spindle angle + x_deg), y and z alike, on the sensor while the spindle turns";
    kind.source = "bearings, drive and draw bar: lines locked to the spindle angle";
    kind.advice = "check bearings, drive and draw bar of the spindle";
    kind.parameters = {
        number("order", "1", Range::positive()).named("times per revolution").drawn(0.35, 12.0),
        orZero("x_n", "N").named("amplitude along x").drawn(2.0, 8.0),
        orZero("y_n", "N").named("amplitude along y").drawn(2.0, 8.0),
        orZero("z_n", "N").named("amplitude along z").drawn(2.0, 8.0),
        angleOrZero("x_deg").named("phase along x at spindle angle 0"),
        angleOrZero("y_deg").named("phase along y at spindle angle 0"),
        angleOrZero("z_deg").named("phase along z at spindle angle 0")};
    kind.needs = {EffectNeed::forces};
    kind.forms = always(
        EffectForm({amplitude("order", {0.05, 60.0, 2e-4, 20.0}, 1.0),
                    planar("x_n", "x_deg", 2000.0, 5e-4, 20.0), planar("y_n", "y_deg", 2000.0, 5e-4, 20.0),
                    planar("z_n", "z_deg", 2000.0, 5e-4, 20.0)})
            .searchedBy(EffectForm::SearchStrategy::spindle_order));
    return kind;
  }

  explicit SpindleOrder(const EffectEntry& entry) : order_(valueOf(entry, "order")) {
    for (std::size_t a = 0; a < 3; ++a) {
      const std::string& axis = axisNames()[a];
      const double size = valueOf(entry, (axis + "_n").c_str());
      const double angle = units::radFromDeg(valueOf(entry, (axis + "_deg").c_str()));
      sine_[a] = size * std::cos(angle);
      cosine_[a] = size * std::sin(angle);
    }
  }

  void addForce(const Instant& now, Axes3& force) const override {
    if (now.speed == 0.0) return;
    const double sine = std::sin(order_ * now.angle), cosine = std::cos(order_ * now.angle);
    for (std::size_t a = 0; a < 3; ++a) force[a] += sine_[a] * sine + cosine_[a] * cosine;
  }

 private:
  double order_;
  std::array<double, 3> sine_{}, cosine_{};  // [N]
};

}  // namespace

EffectKind spindleOrder() {
  return declared<SpindleOrder>();
}

}  // namespace smartmill::effects
