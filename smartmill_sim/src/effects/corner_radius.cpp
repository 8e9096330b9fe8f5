#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Bull-nose or ball end: low on the tool the edge's normal leans towards the axis
/// (smartmill_core/cutting/corner.h).
class CornerRadius : public Effect {
 public:
  explicit CornerRadius(const EffectEntry& entry) : radius_(units::MM * valueOf(entry, "corner_radius_mm")) {}

  void setUp(TwinSetup& setup) const override { setup.corner_radius = radius_; }

 private:
  double radius_;  // [m]
};

const EffectClass<CornerRadius> REGISTERED("corner_radius");

}  // namespace
}  // namespace smartmill::sim
