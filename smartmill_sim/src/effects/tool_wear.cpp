#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Edge coefficients, added ones too, grow with the time that the edge has cut.
class ToolWear : public Effect {
 public:
  explicit ToolWear(const EffectEntry& entry) : growth_(valueOf(entry, "edge_growth_per_min") / 60.0) {}

  void update(const Instant& now, TwinState& state) const override {
    state.law.edge_factor *= 1.0 + growth_ * now.edge_time;
  }
  bool scalesForce() const override { return true; }

 private:
  double growth_;  // [1/s]
};

const EffectClass<ToolWear> REGISTERED("tool_wear");

}  // namespace
}  // namespace smartmill::sim
