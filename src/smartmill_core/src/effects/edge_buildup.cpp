#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Edge forces build up with the chip: all of them times 1 - exp(-h / chip).
class EdgeBuildup : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"edge_buildup", EffectStage::cutting_law, 50};
    kind.title = "less edge force at thin chips";
    kind.description = "edge coefficients multiplied by 1 - exp(-h / chip)";
    kind.source = "Endres, DeVor & Kapoor 1995: ploughing needs some chip to build up";
    kind.advice = "use the corrected model: thin chips have smaller edge forces than the supplied one states";
    kind.parameters = {number("chip_um", "um", Range::notNegative())
                           .named("chip thickness at which 63 % of the edge force acts")
                           .drawn(8.0, 40.0)};
    kind.needs = {EffectNeed::cuts};
    kind.forms = always(
        EffectForm({amplitude("chip_um", {0.0, 300.0, 0.0025, 20.0})}).straight({1.0, 5.0, 15.0, 40.0}));
    return kind;
  }

  explicit EdgeBuildup(const EffectEntry& entry) : chip_(units::UM * valueOf(entry, "chip_um")) {}

  void update(const Instant&, TwinState& state) const override { state.law.edge_chip = chip_; }

 private:
  double chip_;  // [m]
};

}  // namespace

EffectKind edgeBuildup() {
  return declared<EdgeBuildup>();
}

}  // namespace smartmill::effects
