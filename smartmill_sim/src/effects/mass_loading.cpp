#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Mass on the sensor: the first mode of each axis falls by 1/sqrt(1 + ratio), damping ratio as before.
class MassLoading : public Effect {
 public:
  explicit MassLoading(const EffectEntry& entry) : ratio_(valueOf(entry, "mass_ratio")) {}

  void setUp(TwinSetup& setup) const override {
    for (ModalModel& axis : setup.model.force_sensor.axis) {
      if (!axis.modes.empty()) axis.modes.front().frequency /= std::sqrt(1.0 + ratio_);
    }
  }

 private:
  double ratio_;  // [1] added over modal mass
};

const EffectClass<MassLoading> REGISTERED("mass_loading");

}  // namespace
}  // namespace smartmill::sim
