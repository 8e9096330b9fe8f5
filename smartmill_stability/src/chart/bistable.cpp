#include "smartmill_stability/chart/bistable.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr int STEPS = 720;     // over a swing
constexpr int SWINGS = 10;     // tried up to the mean chip
constexpr double LIKE = 1e-9;  // [1] greater than another

constexpr int CHIPS = 200;  // of the table over the arc

/// Both curves' gains over the chip, where every chip swings by the same share of itself: as it is for one
/// direction of vibration.
class Gains {
 public:
  /// @param gain of a curve at a chip
  template <class Gain>
  Gains(const ForceCurves& law, double feed, Gain gain) : feed_(feed) {
    for (int k = 0; k <= CHIPS; ++k) {
      const double chip = feed * std::max(k, 1) / CHIPS;
      table_.push_back({gain(law.tangential, chip), gain(law.radial, chip)});
    }
  }

  std::array<double, 2> at(double chip) const {
    const double place = std::clamp(chip / feed_, 0.0, 1.0) * CHIPS;
    const auto k = std::min(static_cast<std::size_t>(place), table_.size() - 2);
    const double share = place - static_cast<double>(k);
    return {(1.0 - share) * table_[k][0] + share * table_[k + 1][0],
            (1.0 - share) * table_[k][1] + share * table_[k + 1][1]};
  }

 private:
  double feed_;
  std::vector<std::array<double, 2>> table_;
};

std::vector<Limit> limitsWith(RegenerativeSystem system, const Gains& gains, double feed, Method method,
                              const SolverOptions& options, const std::vector<double>& speeds,
                              double max_depth) {
  const auto mean = gains.at(meanChip(system, feed));
  system.kt = mean[0];
  system.kr = mean[1];
  const bool turning = system.cut == Cut::turning;
  system.along_arc = [gains, feed, turning](double angle) {
    return gains.at(turning ? feed : feed * std::sin(angle));
  };
  return makeSolver(method, system, options)->limits(speeds, max_depth);
}

}  // namespace

double swingGain(const ForceCurve& law, double chip, double swing) {
  if (!(swing > 0.0)) return law.slope(chip);
  double sum = 0.0;
  for (int k = 0; k < STEPS; ++k) {
    const double c = std::cos(units::TWO_PI * (k + 0.5) / STEPS);
    sum += law.at(chip + swing * c) * c;
  }
  return 2.0 * sum / (STEPS * swing);
}

double meanChip(const RegenerativeSystem& system, double feed) {
  if (system.cut == Cut::turning) return feed;
  return feed * (std::cos(system.entry) - std::cos(system.exit)) / (system.exit - system.entry);
}

std::vector<BistableLimit> bistableLimits(const RegenerativeSystem& system, const ForceCurves& law,
                                          double feed, Method method, const SolverOptions& options,
                                          const std::vector<double>& speeds, double max_depth) {
  const double chip = meanChip(system, feed), top = law.tangential.knots.back();
  if (!(chip > 0.0) || feed > top * (1.0 + LIKE))
    throw Error(formatted("force curve: a feed of %.4f mm a tooth, the law knows 0 .. %.4f mm",
                          feed / units::MM, top / units::MM));
  if (!(law.tangential.slope(chip) > 0.0))
    throw Error(
        formatted("force curve: the tangential force does not rise at a chip of %.4f mm", chip / units::MM));
  const auto limitsAt = [&](const Gains& gains) {
    return limitsWith(system, gains, feed, method, options, speeds, max_depth);
  };
  // The share of the chip whose gain is greatest, at the mean chip.
  double share = 0.0, greatest = 0.0;
  for (int k = 0; k <= SWINGS; ++k) {
    const double tried = std::hypot(swingGain(law.tangential, chip, chip * k / SWINGS),
                                    swingGain(law.radial, chip, chip * k / SWINGS));
    if (tried > greatest * (1.0 + LIKE)) {
      greatest = tried;
      share = static_cast<double>(k) / SWINGS;
    }
  }
  const auto smalls = limitsAt({law, feed, [](const ForceCurve& curve, double h) { return curve.slope(h); }});
  const auto larges = limitsAt(
      {law, feed, [share](const ForceCurve& curve, double h) { return swingGain(curve, h, share * h); }});
  const auto secants =
      limitsAt({law, feed, [](const ForceCurve& curve, double h) { return curve.at(h) / h; }});
  std::vector<BistableLimit> found;
  for (std::size_t i = 0; i < speeds.size(); ++i)
    found.push_back({speeds[i], smalls[i], larges[i], secants[i]});
  return found;
}

}  // namespace smartmill::stability
