#include "model/effect_declaration.h"
#include "smartmill_core/error.h"

namespace smartmill::effects {
namespace {

/// Below a height one tooth does not cut, and the next one removes its chip.
class LostEdge : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("geometry", "lost_edge", EffectStage::geometry, 20);
    kind.description = "below this height one tooth does not cut, and the next one removes its chip";
    kind.source = "chip rule of formats.md with that edge far inside";
    kind.parameters = {number("tooth", "1", Range::closed(1.0, 20.0)),
                       number("height_mm", "mm", Range::notNegative())};
    kind.needs = {EffectNeed::cuts, EffectNeed::several_teeth};
    kind.forms = [](const Scope& s) {
      const double depth = s.largest_depth / units::MM;
      Forms forms;
      for (int tooth = 1; tooth <= s.nominal.tool->teeth; ++tooth) {
        EffectForm form({amplitude("height_mm", {0.0, 0.95 * depth, 1e-3, 0.3 * depth})});
        form.straight({0.05 * depth, 0.15 * depth, 0.3 * depth});
        forms.push_back(form.number("tooth", tooth).named("tooth " + std::to_string(tooth)));
      }
      return forms;
    };
    return kind;
  }

  explicit LostEdge(const EffectEntry& entry)
      : tooth_(static_cast<int>(valueOf(entry, "tooth")) - 1),
        height_(units::MM * valueOf(entry, "height_mm")) {}

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool || height_ == 0.0) return;
    if (tooth_ >= setup.model.tool->teeth) throw Error("the tool has no tooth " + std::to_string(tooth_ + 1));
    EdgeLayer without_tooth;
    without_tooth.height = height_;
    without_tooth.missing_tooth = tooth_;
    EdgeLayer replaced = without_tooth;
    replaced.missing_tooth = -1;
    replaced.weight = -1.0;
    setup.layers.push_back(without_tooth);
    setup.layers.push_back(replaced);
  }

 private:
  int tooth_;      // from 0
  double height_;  // [m]
};

}  // namespace

EffectKind empiricalLostEdge() {
  return declared<LostEdge>();
}

}  // namespace smartmill::effects
