#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Edge coefficients, added ones included, grow with the time that the edge has cut.
class ToolWear : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"tool_wear", EffectStage::cutting_law, 60};
    kind.title = "tool wear";
    kind.description =
        "edge coefficients (added ones included) multiplied by 1 + growth x cutting time of the edge";
    kind.source = "Teitenberg, Bayoumi & Yucesan 1992";
    kind.advice =
        "measure the wear land under a microscope; change the tool at 0.3 mm (ISO 8688) or where force or "
        "surface exceed the limit of the process";
    kind.parameters = {number("edge_growth_per_min", "1/min")
                           .named("growth of the edge force per minute of cutting")
                           .drawn(0.1, 0.8)};
    kind.needs = {EffectNeed::cuts, EffectNeed::cut_time};
    kind.forms =
        always(EffectForm({amplitude("edge_growth_per_min", {-0.2, 20.0, 0.000125, 1.0})}).straight({0.1}));
    return kind;
  }

  explicit ToolWear(const EffectEntry& entry) : growth_(valueOf(entry, "edge_growth_per_min") / 60.0) {}

  void update(const Instant& now, TwinState& state) const override {
    state.law.edge_factor *= 1.0 + growth_ * now.edge_time;
  }
  bool scalesForce() const override { return true; }

 private:
  double growth_;  // [1/s]
};

}  // namespace

EffectKind toolWear() {
  return declared<ToolWear>();
}

}  // namespace smartmill::effects
