#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Kc times (v / reference)^(-exponent), v the speed of the edge; edge terms stay.
class CuttingSpeed : public Effect {
 public:
  explicit CuttingSpeed(const EffectEntry& entry)
      : exponent_(valueOf(entry, "exponent")),
        reference_(units::M_PER_MIN * valueOf(entry, "reference_m_per_min")) {}

  void update(const Instant& now, TwinState& state) const override {
    const double v = now.speed * state.radius;
    if (v > 0.0) state.law.chip_factor *= std::pow(v / reference_, -exponent_);
  }
  bool scalesForce() const override { return true; }

 private:
  double exponent_, reference_;  // [1], [m/s]
};

const EffectClass<CuttingSpeed> REGISTERED("cutting_speed");

}  // namespace
}  // namespace smartmill::sim
