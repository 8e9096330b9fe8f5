#include "model/effect_declaration.h"

namespace smartmill::effects {
namespace {

/// The feed drive moves at another feed than commanded.
class FeedError : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind{"feed_error", EffectStage::motion, 10};
    kind.title = "actual feed differs from the commanded feed";
    kind.description = "actual feed over commanded feed";
    kind.source = "error of the feed drive or the override";
    kind.advice = "check feed override, number of teeth and units of the program";
    kind.parameters = {number("ratio", "1", Range::positive())
                           .named("actual over commanded feed")
                           .drawnOnBothSides(0.12, 0.25, 1.0)};
    kind.needs = {EffectNeed::cuts};
    kind.forms =
        always(EffectForm({logarithm("ratio", {std::log(0.2), std::log(5.0), 1e-4, 0.2})}).straight({0.02}));
    return kind;
  }

  explicit FeedError(const EffectEntry& entry) : ratio_(valueOf(entry, "ratio")) {}

  void update(const Instant&, TwinState& state) const override { state.feed_ratio *= ratio_; }

 private:
  double ratio_;  // [1]
};

}  // namespace

EffectKind feedError() {
  return declared<FeedError>();
}

}  // namespace smartmill::effects
