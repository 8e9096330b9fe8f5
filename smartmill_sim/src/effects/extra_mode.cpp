#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// One more mode in the force sensor; the direct share gives its gain, so that the static gain stays.
class ExtraMode : public Effect {
 public:
  explicit ExtraMode(const EffectEntry& entry) : axis_(channelOf("f" + wordOf(entry, "axis"))) {
    mode_.frequency = valueOf(entry, "frequency_hz");
    mode_.damping_ratio = valueOf(entry, "damping_ratio");
    mode_.gain = valueOf(entry, "gain");
  }

  void setUp(TwinSetup& setup) const override {
    ModalModel& axis = setup.model.force_sensor.axis[axis_];
    axis.modes.push_back(mode_);
    axis.direct -= mode_.gain;
  }

 private:
  std::size_t axis_;
  Mode mode_;
};

const EffectClass<ExtraMode> REGISTERED("extra_mode");

}  // namespace
}  // namespace smartmill::sim
