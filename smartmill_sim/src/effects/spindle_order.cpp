#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Force on the sensor that is locked to the spindle angle: x_n sin(order x spindle angle + x_deg) and so on.
class SpindleOrder : public Effect {
 public:
  explicit SpindleOrder(const EffectEntry& entry)
      : order_(valueOf(entry, "order")),
        size_{{valueOf(entry, "x_n"), valueOf(entry, "y_n"), valueOf(entry, "z_n")}},
        angle_{{units::radFromDeg(valueOf(entry, "x_deg")), units::radFromDeg(valueOf(entry, "y_deg")),
                units::radFromDeg(valueOf(entry, "z_deg"))}} {}

  void addForce(const Instant& now, Axes3& force) const override {
    if (now.speed == 0.0) return;
    for (std::size_t a = 0; a < 3; ++a) force[a] += size_[a] * std::sin(order_ * now.angle + angle_[a]);
  }

 private:
  double order_;
  std::array<double, 3> size_, angle_;  // [N], [rad]
};

const EffectClass<SpindleOrder> REGISTERED("spindle_order");

}  // namespace
}  // namespace smartmill::sim
