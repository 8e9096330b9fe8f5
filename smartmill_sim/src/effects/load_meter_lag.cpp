#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// The load meter is slower than nominal: its bandwidth.
class LoadMeterLag : public Effect {
 public:
  explicit LoadMeterLag(const EffectEntry& entry) : bandwidth_(valueOf(entry, "bandwidth_hz")) {}

  void setUp(TwinSetup& setup) const override {
    if (setup.model.spindle) setup.model.spindle->load_meter_bandwidth = bandwidth_;
  }

 private:
  double bandwidth_;  // [Hz]
};

const EffectClass<LoadMeterLag> REGISTERED("load_meter_lag");

}  // namespace
}  // namespace smartmill::sim
