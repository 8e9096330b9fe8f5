#include <complex>

#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: what the force channels show beside everything else in each revolution of a cut, always
/// and growing with the feed. It is known at one speed and depth only, and acts nowhere else.
class ChannelRevolution : public Effect {
 public:
  explicit ChannelRevolution(const EffectEntry& entry)
      : share_(valueOf(entry, "share")),
        speed_(units::radPerSecFromRpm(valueOf(entry, "speed_rpm"))),
        depth_(units::MM * valueOf(entry, "depth_mm")),
        chip_(units::UM * valueOf(entry, "chip_um")),
        order_(listOf(entry, "order")) {
    const char* const KEYS[] = {"fx_n", "fy_n", "fz_n"};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::vector<double>& table = listOf(entry, KEYS[axis]);
      if (table.size() != EACH * order_.size())
        throw Error(std::string(KEYS[axis]) + ": four numbers are due for each order");
      for (std::size_t k = 0; k < table.size(); k += EACH) {
        always_[axis].emplace_back(table[k], -table[k + 1]);
        growing_[axis].emplace_back(table[k + 2], -table[k + 3]);
      }
    }
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    if (share_ == 0.0 || now.chip == 0.0 || !near(now.speed, speed_) || !near(now.depth, depth_)) return;
    const double chips = now.chip / chip_;
    for (std::size_t k = 0; k < order_.size(); ++k) {
      const std::complex<double> turn = std::polar(share_, order_[k] * now.angle);
      for (std::size_t axis = 0; axis < 3; ++axis)
        c[FX + axis] += ((always_[axis][k] + chips * growing_[axis][k]) * turn).real();
    }
  }

 private:
  static constexpr std::size_t EACH = 4;  // numbers of an order
  static bool near(double value, double known) {
    constexpr double NEAR = 0.02;
    return std::abs(value - known) < NEAR * known;
  }

  double share_, speed_, depth_, chip_;  // [1], [rad/s], [m], [m]
  std::vector<double> order_;
  std::array<std::vector<std::complex<double>>, 3> always_, growing_;  // [N]
};

const EffectClass<ChannelRevolution> REGISTERED("empirical:revolution");

}  // namespace
}  // namespace smartmill::sim
