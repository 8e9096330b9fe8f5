#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// The axial depth changes along the feed path from engagement.
class DepthTilt : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"depth_tilt", EffectStage::motion, 20};
    kind.title = "workpiece surface tilted along the feed";
    kind.description = "the axial depth changes along the feed path from engagement";
    kind.source = "stock or table not level along the feed";
    kind.advice = "check that the surface of the workpiece is parallel to the feed";
    kind.parameters = {number("slope_um_per_mm", "um/mm")
                           .named("change of the depth along the feed")
                           .drawnOnBothSides(15.0, 60.0)};
    kind.needs = {EffectNeed::cuts};
    kind.forms =
        always(EffectForm({amplitude("slope_um_per_mm", {-900.0, 900.0, 0.0125, 50.0})}).straight({5.0}));
    return kind;
  }

  explicit DepthTilt(const EffectEntry& entry) : slope_(1e-3 * valueOf(entry, "slope_um_per_mm")) {}

  void update(const Instant&, TwinState& state) const override { state.depth_slope += slope_; }

 private:
  double slope_;  // [m/m]
};

}  // namespace

EffectKind depthTilt() {
  return declared<DepthTilt>();
}

}  // namespace smartmill::effects
