#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Bull-nose or ball end: near the tip the edge's normal turns towards the axis
/// (smartmill_core/cutting/corner.h).
class CornerRadius : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"corner_radius", EffectStage::geometry, 50};
    kind.title = "other corner radius of the tool";
    kind.description =
        "bull-nose or ball end: below this height the edge's normal turns from radial to axial; chip, local "
        "radius and direction of the forces follow; replaces the nominal corner radius";
    kind.source = "Altintas & Lee 1996; Engin & Altintas 2001";
    kind.advice = "state the corner radius of the tool in the model";
    kind.parameters = {number("corner_radius_mm", "mm", Range::notNegative())};
    kind.needs = {EffectNeed::cuts};
    kind.forms = [](const Scope& s) {
      const double ball_end = s.nominal.tool->radius() / units::MM;
      const double nominal = s.nominal.tool->edge.corner_radius / units::MM;
      const double side = nominal > 0.5 * ball_end ? -1.0 : 1.0;
      return Forms{EffectForm({amplitude("corner_radius_mm", {0.0, ball_end, 1e-4 * ball_end, 0.3 * ball_end},
                                         nominal)})
                       .straight({side * 0.02 * ball_end, side * 0.1 * ball_end, side * 0.4 * ball_end})};
    };
    kind.draw = [](const MachineModel& machine, EffectKind::Random& random, EffectEntry& entry) {
      entry.numbers["corner_radius_mm"] = between(random, 0.08, 0.5) * machine.tool->radius() / units::MM;
    };
    return kind;
  }

  explicit CornerRadius(const EffectEntry& entry) : radius_(units::MM * valueOf(entry, "corner_radius_mm")) {}

  void setUp(TwinSetup& setup) const override {
    if (setup.model.tool) setup.model.tool->edge.corner_radius = radius_;
  }

 private:
  double radius_;  // [m]
};

}  // namespace

EffectKind cornerRadius() {
  return declared<CornerRadius>();
}

}  // namespace smartmill::effects
