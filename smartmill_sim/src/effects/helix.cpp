#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Another helix angle than nominal.
class Helix : public Effect {
 public:
  explicit Helix(const EffectEntry& entry) : helix_(units::radFromDeg(valueOf(entry, "helix_deg"))) {}

  void setUp(TwinSetup& setup) const override {
    if (setup.model.tool) setup.model.tool->helix = helix_;
  }

 private:
  double helix_;  // [rad]
};

const EffectClass<Helix> REGISTERED("helix");

}  // namespace
}  // namespace smartmill::sim
