#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// The feed drive moves at another feed than commanded.
class FeedError : public Effect {
 public:
  explicit FeedError(const EffectEntry& entry) : ratio_(valueOf(entry, "ratio")) {}

  void update(const Instant&, TwinState& state) const override { state.feed_ratio *= ratio_; }

 private:
  double ratio_;  // [1]
};

const EffectClass<FeedError> REGISTERED("feed_error");

}  // namespace
}  // namespace smartmill::sim
