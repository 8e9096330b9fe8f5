#include <numeric>

#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Each tooth at a radius of its own: chipped, re-ground or badly seated inserts. Only differences act.
class ToothRadius : public Effect {
 public:
  explicit ToothRadius(const EffectEntry& entry) : offset_(listOf(entry, "offset_um")) {
    const double mean =
        std::accumulate(offset_.begin(), offset_.end(), 0.0) / static_cast<double>(offset_.size());
    for (double& o : offset_) o = units::UM * (o - mean);
  }

  void setUp(TwinSetup& setup) const override {
    if (!setup.model.tool) return;
    checkTeeth("tooth_radius", offset_.size(), *setup.model.tool);
    for (std::size_t j = 0; j < offset_.size(); ++j) setup.radius_offset[j] += offset_[j];
  }

 private:
  std::vector<double> offset_;  // [m] mean 0
};

const EffectClass<ToothRadius> REGISTERED("tooth_radius");

}  // namespace
}  // namespace smartmill::sim
