#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// The axial depth changes along the feed path, from where the cut began.
class DepthTilt : public Effect {
 public:
  explicit DepthTilt(const EffectEntry& entry) : slope_(1e-3 * valueOf(entry, "slope_um_per_mm")) {}

  void update(const Instant&, TwinState& state) const override { state.depth_slope += slope_; }

 private:
  double slope_;  // [m/m]
};

const EffectClass<DepthTilt> REGISTERED("depth_tilt");

}  // namespace
}  // namespace smartmill::sim
