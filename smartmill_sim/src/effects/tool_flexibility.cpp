#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Modes besides the tool tip's: the tip vibrates and the chip regenerates.
class ToolFlexibility : public Effect {
 public:
  explicit ToolFlexibility(const EffectEntry& entry) : modes_(entry.flexibility) {}

  void setUp(TwinSetup& setup) const override {
    ToolTip& tip = setup.model.tool_tip;
    tip.x.modes.insert(tip.x.modes.end(), modes_.x.modes.begin(), modes_.x.modes.end());
    tip.y.modes.insert(tip.y.modes.end(), modes_.y.modes.begin(), modes_.y.modes.end());
  }

 private:
  ToolTip modes_;
};

const EffectClass<ToolFlexibility> REGISTERED("tool_flexibility");

}  // namespace
}  // namespace smartmill::sim
