#include <algorithm>
#include <complex>

#include "effect_class.h"

namespace smartmill::sim {
namespace {

/// Without a name: what the force channels show beside everything else in each revolution of a cut, always
/// and growing with the feed, and what bends over the feed besides. It is known at one speed and depth only,
/// and acts nowhere else.
class ChannelRevolution : public Effect {
 public:
  explicit ChannelRevolution(const EffectEntry& entry)
      : share_(valueOf(entry, "share")),
        speed_(units::radPerSecFromRpm(valueOf(entry, "speed_rpm"))),
        depth_(units::MM * valueOf(entry, "depth_mm")),
        chip_(units::UM * valueOf(entry, "chip_um")),
        order_(listOf(entry, "order")) {
    const char* const KEYS[] = {"fx_n", "fy_n", "fz_n"};
    if (entry.lists.count("bend_um") > 0) readBend(entry);
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
    const Place bent = placeOf(now.chip);
    for (std::size_t k = 0; k < order_.size(); ++k) {
      const std::complex<double> turn = std::polar(share_, order_[k] * now.angle);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        std::complex<double> force = always_[axis][k] + chips * growing_[axis][k];
        if (bent.inside) {
          const std::complex<double>* const at = &bend_[axis][k * bend_chip_.size() + bent.below];
          force += (1.0 - bent.beyond) * at[0] + bent.beyond * at[1];
        }
        c[FX + axis] += (force * turn).real();
      }
    }
  }

 private:
  static constexpr std::size_t EACH = 4;  // numbers of an order
  static bool near(double value, double known) {
    constexpr double NEAR = 0.02;
    return std::abs(value - known) < NEAR * known;
  }

  // Between two of the feeds at which the bend is known.
  struct Place {
    bool inside = false;
    std::size_t below = 0;
    double beyond = 0.0;  // [1] of the way to the next one
  };
  Place placeOf(double chip) const {
    const auto next = std::upper_bound(bend_chip_.begin(), bend_chip_.end(), chip);
    if (next == bend_chip_.begin() || next == bend_chip_.end()) return {};
    const auto below = static_cast<std::size_t>(next - bend_chip_.begin()) - 1;
    return {true, below, (chip - bend_chip_[below]) / (bend_chip_[below + 1] - bend_chip_[below])};
  }

  void readBend(const EffectEntry& entry) {
    for (const double chip : listOf(entry, "bend_um")) {
      if (!bend_chip_.empty() && units::UM * chip <= bend_chip_.back())
        throw Error("bend_um: rising feeds are due");
      bend_chip_.push_back(units::UM * chip);
    }
    const char* const KEYS[] = {"fx_bend_n", "fy_bend_n", "fz_bend_n"};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::vector<double>& table = listOf(entry, KEYS[axis]);
      if (table.size() != 2 * bend_chip_.size() * order_.size())
        throw Error(std::string(KEYS[axis]) + ": two numbers are due for each order and feed of bend_um");
      for (std::size_t k = 0; k < table.size(); k += 2) bend_[axis].emplace_back(table[k], -table[k + 1]);
    }
  }

  double share_, speed_, depth_, chip_;  // [1], [rad/s], [m], [m]
  std::vector<double> order_;
  std::array<std::vector<std::complex<double>>, 3> always_, growing_;  // [N]
  std::vector<double> bend_chip_;                                      // [m] rising
  std::array<std::vector<std::complex<double>>, 3> bend_;  // [N] of each order at each of these feeds
};

const EffectClass<ChannelRevolution> REGISTERED("empirical:revolution");

}  // namespace
}  // namespace smartmill::sim
