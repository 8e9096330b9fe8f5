#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Rotating force m e omega^2 on the sensor: x sin(a), y cos(a), a = spindle angle + angle.
class Unbalance : public Effect {
 public:
  explicit Unbalance(const EffectEntry& entry)
      : mass_eccentricity_(1e-6 * valueOf(entry, "mass_eccentricity_g_mm")),
        angle_(units::radFromDeg(valueOf(entry, "angle_deg"))) {}

  void addForce(const Instant& now, Axes3& force) const override {
    const double size = mass_eccentricity_ * now.speed * now.speed, a = now.angle + angle_;
    force[0] += size * std::sin(a);
    force[1] += size * std::cos(a);
  }

 private:
  double mass_eccentricity_, angle_;  // [kg m], [rad]
};

const EffectClass<Unbalance> REGISTERED("unbalance");

}  // namespace
}  // namespace smartmill::sim
