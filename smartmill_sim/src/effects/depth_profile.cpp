#include <limits>

#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: the chip coefficients times a factor over a height from the tip up, or below the work's
/// surface.
class DepthProfile : public Effect {
 public:
  explicit DepthProfile(const EffectEntry& entry)
      : from_surface_(wordOf(entry, "from") == "surface"),
        height_(units::MM * valueOf(entry, "height_mm")),
        extra_(valueOf(entry, "factor") - 1.0) {}

  void setUp(TwinSetup& setup) const override {
    EdgeLayer lower;
    lower.height = height_;
    lower.from_surface = from_surface_;
    lower.share = EdgeLayer::Share::chip;
    lower.weight = from_surface_ ? -extra_ : extra_;
    setup.layers.push_back(lower);
    if (!from_surface_) return;
    // What lies below the surface is the whole less the part under it.
    EdgeLayer whole = lower;
    whole.height = std::numeric_limits<double>::infinity();
    whole.from_surface = false;
    whole.weight = extra_;
    setup.layers.push_back(whole);
  }

 private:
  bool from_surface_;
  double height_, extra_;  // [m], [1]
};

const EffectClass<DepthProfile> REGISTERED("empirical:depth_profile");

}  // namespace
}  // namespace smartmill::sim
