#include <algorithm>
#include <complex>

#include "model/effect_declaration.h"
#include "smartmill_core/error.h"

namespace smartmill::effects {
namespace {

constexpr std::array<const char*, 3> KEYS{{"fx_n", "fy_n", "fz_n"}};
constexpr std::array<const char*, 3> BEND_KEYS{{"fx_bend_n", "fy_bend_n", "fz_bend_n"}};

/// Periodic force over a revolution that is added to the force channels of a cut: a constant term, a term in
/// proportion to the feed and a table over the feed. It acts at one speed and depth only.
class ChannelRevolution : public Effect {
 public:
  static EffectKind declaration() {
    EffectKind kind = empirical("channel", "revolution", EffectStage::sensor_output, 30);
    kind.description =
        "share times a sum over orders of the spindle is added to each force channel in cuts of this speed "
        "and depth: of each order cosine and sine of a constant term, then of a term in proportion to feed "
        "per tooth / chip_um; in addition of each order cosine and sine at each feed per tooth bend_um, "
        "piecewise linear between them, 0 beyond";
    kind.source = "Fourier series over a revolution, linear over the feed or tabulated";
    kind.parameters = {number("share", "1", Range::notNegative()),
                       number("speed_rpm", "rpm", Range::positive()),
                       number("depth_mm", "mm", Range::positive()),
                       number("chip_um", "um", Range::positive()), table("order", "1", Range::notNegative())};
    for (const char* key : KEYS) kind.parameters.push_back(table(key, "N"));
    kind.parameters.push_back(tableOrNone("bend_um", "um", Range::positive()));
    for (const char* key : BEND_KEYS) kind.parameters.push_back(tableOrNone(key, "N"));
    kind.needs = {EffectNeed::cuts, EffectNeed::forces};
    // The residual determines the shape, a fit the share.
    kind.forms = [](const Scope& s) {
      EffectForm form({amplitude("share", {0.0, 1.0, 1e-4, 1.0})});
      form.number("speed_rpm", 6000.0)
          .number("depth_mm", s.largest_depth / units::MM)
          .number("chip_um", s.largest_chip / units::UM)
          .list("order", {1.0});
      for (const char* key : KEYS) form.list(key, {0.0, 0.0, 0.0, 0.0});
      return Forms{form};
    };
    return kind;
  }

  explicit ChannelRevolution(const EffectEntry& entry)
      : share_(valueOf(entry, "share")),
        speed_(units::radPerSecFromRpm(valueOf(entry, "speed_rpm"))),
        depth_(units::MM * valueOf(entry, "depth_mm")),
        chip_(units::UM * valueOf(entry, "chip_um")),
        order_(listOf(entry, "order")) {
    if (entry.lists.count("bend_um") > 0) readBend(entry);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::vector<double>& table = listOf(entry, KEYS[axis]);
      if (table.size() != PER_ORDER * order_.size())
        throw Error(std::string(KEYS[axis]) + ": expected four numbers for each order");
      for (std::size_t k = 0; k < table.size(); k += PER_ORDER) {
        constant_[axis].emplace_back(table[k], -table[k + 1]);
        linear_[axis].emplace_back(table[k + 2], -table[k + 3]);
      }
    }
  }

  void measure(const Instant& now, ChannelValues& c) const override {
    if (share_ == 0.0 || now.chip == 0.0 || !isNear(now.speed, speed_) || !isNear(now.depth, depth_)) return;
    const double chips = now.chip / chip_;
    const Segment bend = segmentOf(now.chip);
    for (std::size_t k = 0; k < order_.size(); ++k) {
      const std::complex<double> rotation = std::polar(share_, order_[k] * now.angle);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        std::complex<double> force = constant_[axis][k] + chips * linear_[axis][k];
        if (bend.inside) {
          const std::complex<double>* const at = &bend_[axis][k * bend_chip_.size() + bend.below];
          force += (1.0 - bend.share) * at[0] + bend.share * at[1];
        }
        c[FX + axis] += (force * rotation).real();
      }
    }
  }

 private:
  static constexpr std::size_t PER_ORDER = 4;  // numbers
  static bool isNear(double value, double reference) {
    constexpr double TOLERANCE = 0.02;
    return std::abs(value - reference) < TOLERANCE * reference;
  }

  // Segment between two of the tabulated feeds.
  struct Segment {
    bool inside = false;
    std::size_t below = 0;
    double share = 0.0;  // [1] of the way to the next feed
  };
  Segment segmentOf(double chip) const {
    const auto next = std::upper_bound(bend_chip_.begin(), bend_chip_.end(), chip);
    if (next == bend_chip_.begin() || next == bend_chip_.end()) return {};
    const auto below = static_cast<std::size_t>(next - bend_chip_.begin()) - 1;
    return {true, below, (chip - bend_chip_[below]) / (bend_chip_[below + 1] - bend_chip_[below])};
  }

  void readBend(const EffectEntry& entry) {
    for (const double chip : listOf(entry, "bend_um")) {
      if (!bend_chip_.empty() && units::UM * chip <= bend_chip_.back())
        throw Error("bend_um: expected rising feeds");
      bend_chip_.push_back(units::UM * chip);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::vector<double>& table = listOf(entry, BEND_KEYS[axis]);
      if (table.size() != 2 * bend_chip_.size() * order_.size())
        throw Error(std::string(BEND_KEYS[axis]) +
                    ": expected two numbers for each order and feed of bend_um");
      for (std::size_t k = 0; k < table.size(); k += 2) bend_[axis].emplace_back(table[k], -table[k + 1]);
    }
  }

  double share_, speed_, depth_, chip_;  // [1], [rad/s], [m], [m]
  std::vector<double> order_;
  std::array<std::vector<std::complex<double>>, 3> constant_, linear_;  // [N]
  std::vector<double> bend_chip_;                                       // [m] rising
  std::array<std::vector<std::complex<double>>, 3> bend_;               // [N] by order, then by feed
};

}  // namespace

EffectKind empiricalRevolution() {
  return declared<ChannelRevolution>();
}

}  // namespace smartmill::effects
