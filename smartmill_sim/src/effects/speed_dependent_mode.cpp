#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// The first sensor mode of each axis falls linearly with the spindle speed.
class SpeedDependentMode : public Effect {
 public:
  explicit SpeedDependentMode(const EffectEntry& entry) : softening_(valueOf(entry, "softening_per_krpm")) {}

  void update(const Instant& now, TwinState& state) const override {
    // The line ends well before the mode would vanish.
    const double factor = 1.0 - softening_ * 1e-3 * units::rpmFromRadPerSec(now.speed);
    state.sensor_frequency *= std::max(factor, 0.05);
  }

 private:
  double softening_;  // [1] per 1000 rpm
};

const EffectClass<SpeedDependentMode> REGISTERED("speed_dependent_mode");

}  // namespace
}  // namespace smartmill::sim
