#include "smartmill_stability/chart/bistable.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/formatted.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr int STEPS = 720;          // of one oscillation
constexpr int AMPLITUDES = 10;      // from 0 to the mean chip thickness
constexpr double TOLERANCE = 1e-9;  // [1] relative, of a comparison

constexpr int CHIPS = 200;  // of the table over the arc

/// Tangential and radial gain over the chip thickness. The amplitude is the same fraction of every chip
/// thickness, as for a vibration in one direction.
class Gains {
 public:
  /// @param gain of a curve at a chip thickness
  template <class Gain>
  Gains(const ForceCurves& law, double feed, Gain gain) : feed_(feed) {
    for (int k = 0; k <= CHIPS; ++k) {
      const double chip = feed * std::max(k, 1) / CHIPS;
      table_.push_back({gain(law.tangential, chip), gain(law.radial, chip)});
    }
  }

  std::array<double, 2> at(double chip) const {
    const double position = std::clamp(chip / feed_, 0.0, 1.0) * CHIPS;
    const auto k = std::min(static_cast<std::size_t>(position), table_.size() - 2);
    const double share = position - static_cast<double>(k);
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

double describingFunction(const ForceCurve& law, double chip, double amplitude) {
  if (!(amplitude > 0.0)) return law.slope(chip);
  double sum = 0.0;
  for (int k = 0; k < STEPS; ++k) {
    const double c = std::cos(units::TWO_PI * (k + 0.5) / STEPS);
    sum += law.at(chip + amplitude * c) * c;
  }
  return 2.0 * sum / (STEPS * amplitude);
}

double meanChip(const RegenerativeSystem& system, double feed) {
  if (system.cut == Cut::turning) return feed;
  return feed * (std::cos(system.entry) - std::cos(system.exit)) / (system.exit - system.entry);
}

std::vector<BistableLimit> bistableLimits(const RegenerativeSystem& system, const ForceCurves& law,
                                          double feed, Method method, const SolverOptions& options,
                                          const std::vector<double>& speeds, double max_depth) {
  const double chip = meanChip(system, feed), top = law.tangential.knots.back();
  if (!(chip > 0.0) || feed > top * (1.0 + TOLERANCE))
    throw Error(
        formatted("force curve: feed per tooth %.4f mm: expected a value within the curve, 0 .. %.4f mm",
                  feed / units::MM, top / units::MM));
  if (!(law.tangential.slope(chip) > 0.0))
    throw Error(
        formatted("force curve: the tangential force does not rise at the mean chip thickness %.4f mm; "
                  "expected a positive "
                  "slope",
                  chip / units::MM));
  const auto limitsAt = [&](const Gains& gains) {
    return limitsWith(system, gains, feed, method, options, speeds, max_depth);
  };
  // Amplitude over chip thickness with the largest gain, at the mean chip thickness.
  double share = 0.0, largest = 0.0;
  for (int k = 0; k <= AMPLITUDES; ++k) {
    const double amplitude = chip * k / AMPLITUDES;
    const double gain = std::hypot(describingFunction(law.tangential, chip, amplitude),
                                   describingFunction(law.radial, chip, amplitude));
    if (gain > largest * (1.0 + TOLERANCE)) {
      largest = gain;
      share = static_cast<double>(k) / AMPLITUDES;
    }
  }
  const auto smalls = limitsAt({law, feed, [](const ForceCurve& curve, double h) { return curve.slope(h); }});
  const auto larges = limitsAt({law, feed, [share](const ForceCurve& curve, double h) {
                                  return describingFunction(curve, h, share * h);
                                }});
  const auto secants =
      limitsAt({law, feed, [](const ForceCurve& curve, double h) { return curve.at(h) / h; }});
  std::vector<BistableLimit> found;
  for (std::size_t i = 0; i < speeds.size(); ++i)
    found.push_back({speeds[i], smalls[i], larges[i], secants[i]});
  return found;
}

}  // namespace smartmill::stability
