#include "effect_class.h"
#include "smartmill_core/cutting/chip_rule.h"

namespace smartmill::sim {
namespace {

/// The cutter's axis lies beside the spindle's: tooth j cuts at R + offset cos(angle - position of tooth j).
/// Which surface it then meets comes out of the geometry.
class Runout : public Effect {
 public:
  explicit Runout(const EffectEntry& entry)
      : offset_(valueOf(entry, "offset_um") * units::UM),
        angle_(units::radFromDeg(valueOf(entry, "angle_deg"))) {}

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool) return;
    const std::vector<double> radii = runoutRadii(*setup.model.tool, offset_, angle_);
    for (std::size_t j = 0; j < radii.size(); ++j) setup.radius_offset[j] += radii[j];
  }

 private:
  double offset_, angle_;  // [m], [rad]
};

const EffectClass<Runout> REGISTERED("runout");

}  // namespace
}  // namespace smartmill::sim
