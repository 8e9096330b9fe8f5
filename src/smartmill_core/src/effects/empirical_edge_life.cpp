#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// Chip or edge coefficients approach a final value over the life of the edge.
class EdgeLife : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("law", "edge_life", EffectStage::cutting_law, 50);
    kind.description =
        "chip or edge coefficients times 1 + amplitude (1 - exp(-t / constant)), t the time that the edge "
        "has cut";
    kind.source = "exponential approach";
    kind.parameters = {oneOf("of", {"chip", "edge"}), number("amplitude", "1", Range::above(-1.0)),
                       number("time_constant_s", "s", Range::positive())};
    kind.needs = {EffectNeed::cuts, EffectNeed::cut_time};
    kind.forms = [](const Scope&) {
      constexpr double FIRST_OBSERVED = 60.0;  // [s] of cutting
      Forms forms;
      for (const char* of : {"chip", "edge"}) {
        EffectForm form = exponentialApproach({-0.9, 3.0, 1e-4, 0.3}, 0.02, FIRST_OBSERVED);
        forms.push_back(form.word("of", of).named(of));
      }
      return forms;
    };
    return kind;
  }

  explicit EdgeLife(const EffectEntry& entry)
      : chip_(wordOf(entry, "of") == "chip"),
        amplitude_(valueOf(entry, "amplitude")),
        constant_(valueOf(entry, "time_constant_s")) {}

  void update(const Instant& now, TwinState& state) const override {
    (chip_ ? state.law.chip_factor : state.law.edge_factor) *=
        1.0 - amplitude_ * std::expm1(-now.edge_time / constant_);
  }
  bool scalesForce() const override { return true; }

 private:
  bool chip_;
  double amplitude_, constant_;  // [1], [s]
};

}  // namespace

EffectKind empiricalEdgeLife() {
  return declared<EdgeLife>();
}

}  // namespace smartmill::effects
