#include "smartmill_stability/chart/risk.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>

#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {
namespace {

struct DrawOptions {
  double unknown = 0.1;  ///< [1] relative standard deviation of a value without one: typical of a catalogue
  double most = 0.5;     ///< [1] largest relative standard deviation; above, drawn values mean nothing
  std::size_t lines = 600;    ///< of the receptances; their error cancels in the ratio of draw to mean
  double speed_step = 0.004;  ///< [1] relative, between the speeds of a search; below any speed margin
};
constexpr DrawOptions DRAW;

double shareOf(double deviation, double value, double least) {
  const double share = std::isfinite(deviation) && value != 0.0 ? std::abs(deviation / value) : DRAW.unknown;
  return std::min(DRAW.most, std::hypot(share, least));
}

std::unique_ptr<FloquetSolver> solverOf(const RegenerativeSystem& system) {
  return makeFloquetSolver(Method::collocation, system, SolverOptions::ofManyPoints());
}

bool isStable(const FloquetSolver& solver, double speed, double depth, double margin) {
  for (const double side : {0.0, margin, -margin}) {
    if (solver.multiplier(speed * (1.0 + side), depth).radius() > 1.0) return false;
  }
  return true;
}

}  // namespace

DrawnMachines::DrawnMachines(const UncertainSystem& system, const RiskOptions& options)
    : system_(system), options_(options), random_(options.seed), mean_(solverOf(system.mean())) {
  if (options.draws < 1) throw Error("draws: " + std::to_string(options.draws) + ": expected at least 1");
}

DrawnMachines::~DrawnMachines() = default;

std::optional<double> DrawnMachines::probability(double speed, double depth) {
  int chattering = 0;
  for (int i = 0; i < options_.draws; ++i) {
    while (static_cast<int>(drawn_.size()) <= i) drawn_.push_back(solverOf(system_.draw(random_)));
    chattering += !isStable(*drawn_[static_cast<std::size_t>(i)], speed, depth, options_.speed_margin);
    if (chattering > options_.risk * options_.draws) return std::nullopt;
  }
  return static_cast<double>(chattering) / options_.draws;
}

bool DrawnMachines::meanIsStable(double speed, double depth) const {
  return isStable(*mean_, speed, depth, options_.speed_margin);
}

UncertainSystem measuredSystem(const RegenerativeSystem& system, const ModalModel& x, const ModalModel& y,
                               const WorkpieceModes& workpiece, const CoefficientSet& coefficients,
                               const LeastDeviations& least) {
  std::vector<ModeUncertainty> modes;
  for (const ModalModel* model : {&x, &y, &workpiece.x, &workpiece.y}) {
    const std::size_t before = modes.size(), count = systemModes(*model, 0).size();
    for (const Mode& mode : model->modes) {
      if (mode.gain == 0.0) continue;
      modes.push_back({shareOf(mode.frequency_std, mode.frequency, least.frequency),
                       shareOf(mode.damping_ratio_std, mode.damping_ratio, least.damping),
                       shareOf(mode.gain_std, mode.gain, least.gain)});
    }
    // The residual compliance is one more mode.
    modes.resize(before + count, {DRAW.unknown, DRAW.unknown, DRAW.unknown});
  }
  const CuttingCoefficients &value = coefficients.value, &deviation = coefficients.std_dev;
  const double kt = shareOf(deviation.ktc, value.ktc, least.cutting);
  const bool radial = std::isfinite(deviation.krc) && value.krc > 0.0;
  const double kr = radial ? shareOf(deviation.krc, value.krc, least.cutting) : std::hypot(kt, least.radial);
  return UncertainSystem(system, modes, kt, std::min(DRAW.most, kr));
}

DrawnLimits drawnLimits(const UncertainSystem& system, const std::vector<double>& speeds, int draws,
                        unsigned seed) {
  if (draws < 1) throw Error("draws: " + std::to_string(draws) + ": expected at least 1");
  double highest = 0.0;
  for (const SystemMode& mode : system.mean().modes) highest = std::max(highest, mode.frequency);
  double typical = 1.0;  // [m] depth over which an inclined edge is averaged
  const auto zeroOrder = [&](const RegenerativeSystem& machine) {
    const RegenerativeProcess process{machine.teeth, machine.entry, machine.exit, machine.kt,
                                      machine.meanRadial(typical) / machine.kt};
    return zeroOrderLimit(process, responseOf(machine.modes, 1.0, 2.0 * highest, DRAW.lines), speeds).depth;
  };
  if (system.mean().edge.inclined()) {
    const std::vector<double> first = zeroOrder(system.mean());
    const double least = *std::min_element(first.begin(), first.end());
    if (std::isfinite(least)) typical = least;
  }
  DrawnLimits limits;
  limits.mean = zeroOrder(system.mean());
  std::mt19937_64 random(seed);
  for (int draw = 0; draw < draws; ++draw) limits.drawn.push_back(zeroOrder(system.draw(random)));
  return limits;
}

std::vector<double> depthsAtRisk(const DrawnLimits& limits, const std::vector<double>& speeds, double risk,
                                 double speed_margin) {
  const std::size_t draws = limits.drawn.size();
  std::vector<double> shares;
  std::vector<double> least(draws);
  std::size_t from = 0, to = 0;
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    while (speeds[from] < speeds[k] * (1.0 - speed_margin)) ++from;
    while (to + 1 < speeds.size() && speeds[to + 1] <= speeds[k] * (1.0 + speed_margin)) ++to;
    to = std::max(to, k);
    for (std::size_t draw = 0; draw < draws; ++draw) {
      const std::vector<double>& depth = limits.drawn[draw];
      least[draw] = *std::min_element(depth.begin() + static_cast<std::ptrdiff_t>(from),
                                      depth.begin() + static_cast<std::ptrdiff_t>(to) + 1);
    }
    // This many machines may chatter; the result is the limit of the next one.
    const auto at = static_cast<std::ptrdiff_t>(std::floor(risk * static_cast<double>(draws)));
    std::nth_element(least.begin(), least.begin() + at, least.end());
    const double depth = least[static_cast<std::size_t>(at)];
    const double share = depth / limits.mean[k];
    shares.push_back(std::isnan(share) ? 1.0 : share);
  }
  return shares;
}

std::optional<StableSpeed> stableSpeed(const UncertainSystem& system, double depth, double low, double high,
                                       const RiskOptions& options) {
  if (!(depth > 0.0) || !(low > 0.0) || !(high >= low))
    throw Error("stable speed: expected a depth above 0 and speeds 0 < low <= high");
  DrawnMachines drawn(system, options);
  const auto mean = solverOf(system.mean());
  std::vector<double> speeds;
  std::vector<bool> stable;
  for (double s = low; s <= high * (1.0 + 1e-9); s *= 1.0 + DRAW.speed_step) {
    speeds.push_back(s);
    stable.push_back(mean->multiplier(s, depth).radius() < 1.0);
  }
  for (std::size_t k = speeds.size(); k-- > 0;) {
    std::size_t below = k, above = k;
    while (stable[k] && below > 0 && stable[below - 1]) --below;
    while (stable[k] && above + 1 < speeds.size() && stable[above + 1]) ++above;
    // At the ends of the range the margin lies beyond the solved speeds; the drawn machines decide there.
    const bool margin_below = below == 0 || speeds[below] <= speeds[k] * (1.0 - options.speed_margin);
    const bool margin_above =
        above + 1 == speeds.size() || speeds[above] >= speeds[k] * (1.0 + options.speed_margin);
    if (!stable[k] || !margin_below || !margin_above) continue;
    if (const std::optional<double> probability = drawn.probability(speeds[k], depth))
      return StableSpeed{speeds[k], *probability, speeds[below], speeds[above]};
  }
  return std::nullopt;
}

}  // namespace smartmill::stability
