#include <cmath>

#include "model/effect_declaration.h"
#include "smartmill_core/cutting/chip_rule.h"
#include "smartmill_core/units.h"

namespace smartmill::effects {
namespace {

/// Offset between the axes of cutter and spindle: tooth j cuts at R + offset cos(angle - position of tooth
/// j). The surface that it meets follows from the geometry.
class Runout : public Effect {
  static constexpr double TYPICAL = 15.0;  // [um]
  static constexpr int DIRECTIONS = 8;

 public:
  static EffectKind declaration() {
    EffectKind kind{"runout", EffectStage::geometry, 20};
    kind.title = "tool axis off centre";
    kind.description = "tooth j cuts at radius R + offset cos(angle - position of tooth j)";
    kind.source = "Kline & DeVor 1983; Dunwoody 6.1";
    kind.advice =
        "put a dial indicator on the shank and turn the spindle by hand; clean taper, collet and nut, clamp "
        "again and repeat until the reading is within the tolerance of the holder";
    kind.parameters = {
        number("offset_um", "um", Range::notNegative()).named("tool axis off centre by").drawn(5.0, 25.0),
        angle("angle_deg")};
    kind.needs = {EffectNeed::cuts};
    EffectForm form =
        EffectForm({planar("offset_um", "angle_deg", 200.0, 5e-4, 20.0)}).straight({1.0, TYPICAL});
    // Derivatives do not show that a tooth leaves the cut: it depends on the direction.
    for (int k = 0; k < DIRECTIONS; ++k) {
      const double angle = units::TWO_PI * k / DIRECTIONS;
      form.startingAt({TYPICAL * std::cos(angle), TYPICAL * std::sin(angle)});
    }
    kind.forms = always(form);
    return kind;
  }

  explicit Runout(const EffectEntry& entry)
      : offset_(valueOf(entry, "offset_um") * units::UM),
        angle_(units::radFromDeg(valueOf(entry, "angle_deg"))) {}

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool) return;
    const std::vector<double> radii = runoutRadii(*setup.model.tool, offset_, angle_);
    for (std::size_t j = 0; j < radii.size(); ++j) setup.radius_offset[j] += radii[j];
  }

 private:
  double offset_, angle_;  // [m], [rad]
};

}  // namespace

EffectKind runout() {
  return declared<Runout>();
}

}  // namespace smartmill::effects
