#include "classes.h"

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
    for (std::size_t j = 0; j < setup.radius_offset.size(); ++j) {
      setup.radius_offset[j] +=
          offset_ * std::cos(angle_ - setup.model.tool->toothAngle(static_cast<int>(j)));
    }
  }

 private:
  double offset_, angle_;  // [m], [rad]
};

}  // namespace

EffectPtr makeRunout(const EffectEntry& entry) {
  return std::make_unique<Runout>(entry);
}

}  // namespace smartmill::sim
