#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Force on the sensor that is locked to the spindle angle: x_n sin(order x spindle angle + x_deg) and so on.
class SpindleOrder : public Effect {
 public:
  explicit SpindleOrder(const EffectEntry& entry) : order_(valueOf(entry, "order")) {
    const char* const AXES[] = {"x", "y", "z"};
    for (std::size_t a = 0; a < 3; ++a) {
      const std::string axis = AXES[a];
      const double size = valueOf(entry, (axis + "_n").c_str());
      const double angle = units::radFromDeg(valueOf(entry, (axis + "_deg").c_str()));
      sine_[a] = size * std::cos(angle);
      cosine_[a] = size * std::sin(angle);
    }
  }

  void addForce(const Instant& now, Axes3& force) const override {
    if (now.speed == 0.0) return;
    const double sine = std::sin(order_ * now.angle), cosine = std::cos(order_ * now.angle);
    for (std::size_t a = 0; a < 3; ++a) force[a] += sine_[a] * sine + cosine_[a] * cosine;
  }

 private:
  double order_;
  std::array<double, 3> sine_{}, cosine_{};  // [N]
};

const EffectClass<SpindleOrder> REGISTERED("spindle_order");

}  // namespace
}  // namespace smartmill::sim
