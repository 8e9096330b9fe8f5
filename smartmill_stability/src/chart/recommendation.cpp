#include "chart/recommendation.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "smartmill_core/cutting/lobe_flanks.h"
#include "smartmill_stability/chart/risk.h"

namespace smartmill::stability {
namespace {

/// Worst value over the speeds within the margin on both sides, including the next speed of the grid.
double around(const StabilityLimit& limit, std::size_t k, double margin,
              const std::function<bool(double, double)>& worse) {
  double worst = limit.depth[k];
  const double speed = limit.spindle_speed[k];
  for (std::size_t j = k; j > 0 && limit.spindle_speed[j] >= speed * (1.0 - margin); --j) {
    if (worse(limit.depth[j - 1], worst)) worst = limit.depth[j - 1];
  }
  for (std::size_t j = k; j + 1 < limit.depth.size() && limit.spindle_speed[j] <= speed * (1.0 + margin);
       ++j) {
    if (worse(limit.depth[j + 1], worst)) worst = limit.depth[j + 1];
  }
  return worst;
}

bool removesMore(const StabilityPoint& a, const StabilityPoint& b) {
  return a.material_removal_rate > b.material_removal_rate;
}

/// The first points in the given order, one for each pocket.
std::vector<StabilityPoint> pick(
    std::vector<StabilityPoint> points, int count,
    const std::function<bool(const StabilityPoint&, const StabilityPoint&)>& better) {
  std::stable_sort(points.begin(), points.end(), better);
  std::vector<StabilityPoint> chosen;
  for (const StabilityPoint& point : points) {
    if (static_cast<int>(chosen.size()) >= count) break;
    const bool near = std::any_of(chosen.begin(), chosen.end(), [&](const StabilityPoint& other) {
      return std::abs(point.spindle_speed / other.spindle_speed - 1.0) < RECOMMENDATION.same_pocket;
    });
    if (!near) chosen.push_back(point);
  }
  return chosen;
}

/// Of the neighbouring cuts with nearly the same removal rate as the best, the one with the largest margin of
/// speed to the nearer flank of its lobe. Where the power limits the removal rate it is constant over the
/// pocket.
StabilityPoint farthestFromFlanks(const StabilityLimit& limit, const std::vector<StabilityPoint>& cuts,
                                  const StabilityPoint& best) {
  const auto margin = [&](const StabilityPoint& cut) {
    const auto [below, above] = lobeFlanks(limit, cut.spindle_speed, cut.axial_depth);
    return std::min(below, above) / cut.spindle_speed;
  };
  const auto at = std::find_if(cuts.begin(), cuts.end(), [&](const StabilityPoint& cut) {
    return cut.spindle_speed == best.spindle_speed;
  });
  const auto enough = [&](const StabilityPoint& cut) {
    return cut.material_removal_rate >= RECOMMENDATION.as_much * best.material_removal_rate;
  };
  auto from = at, to = at;
  while (from != cuts.begin() && enough(*(from - 1))) --from;
  while (to != cuts.end() && enough(*to)) ++to;
  return *std::max_element(
      from, to, [&](const StabilityPoint& a, const StabilityPoint& b) { return margin(a) < margin(b); });
}

}  // namespace

int Recommendation::extraSpeeds(const ChartParameters& parameters) {
  return parameters.speed_margin > 0.0 ? RECOMMENDATION.extra_speeds : 0;
}

std::vector<double> Recommendation::wideSpeeds(const ChartParameters& parameters) {
  const int n = parameters.speeds, extra = extraSpeeds(parameters);
  const double low = parameters.speed_low, high = parameters.speed_high,
               step = parameters.speed_margin / RECOMMENDATION.extra_speeds;
  std::vector<double> speeds;
  for (int i = -extra; i < n + extra; ++i) {
    speeds.push_back(i < 0    ? low * (1.0 + step * i)
                     : i >= n ? high * (1.0 + step * (i - n + 1))
                              : low + (high - low) * i / (n - 1));
  }
  return speeds;
}

void Recommendation::addTo(StabilityChart& chart) const {
  recommend(chart);
  proposeUnstable(chart);
}

/// [1] Depth at the accepted risk over the limit at each speed; +inf without modes, which drawing requires.
std::vector<double> Recommendation::depthShares(const std::vector<double>& speeds) const {
  std::vector<double> shares(speeds.size(), std::numeric_limits<double>::infinity());
  const std::optional<UncertainSystem> uncertain = machine_.uncertainSystem(cut_);
  if (parameters_.risk > 0.0 && uncertain) {
    shares = depthsAtRisk(drawnLimits(*uncertain, speeds, RECOMMENDATION.draws, RECOMMENDATION.seed), speeds,
                          parameters_.risk, parameters_.speed_margin);
  }
  return shares;
}

void Recommendation::recommend(StabilityChart& chart) const {
  const std::vector<double>& speeds = chart.limit.spindle_speed;
  const std::vector<double> shares = depthShares(speeds);
  const std::optional<SizeLimit> size = sizeLimit();
  std::vector<StabilityPoint> cuts, peaks;
  for (std::size_t k = 0; k < speeds.size(); ++k) {
    const double stable = around(wide_, k + static_cast<std::size_t>(extraSpeeds(parameters_)),
                                 parameters_.speed_margin, std::less<>());
    double depth = std::min({(1.0 - parameters_.depth_margin) * stable, shares[k] * chart.limit.depth[k],
                             permittedDepth(chart, k)});
    const double least = RECOMMENDATION.least_depth * depth;
    while (size && depth > 0.0 && !size->meanHolds(speeds[k], depth))
      depth = RECOMMENDATION.reduction * depth > least ? RECOMMENDATION.reduction * depth : 0.0;
    cuts.push_back(load_.point(speeds[k], depth, chart.limit.depth[k], chart.limit.chatter_frequency[k]));
  }
  for (std::size_t k = 0; k < cuts.size(); ++k) {
    const double rate = cuts[k].material_removal_rate;
    const bool above_left = k == 0 || rate > cuts[k - 1].material_removal_rate;
    const bool above_right = k + 1 == cuts.size() || rate >= cuts[k + 1].material_removal_rate;
    if (rate > 0.0 && above_left && above_right) peaks.push_back(cuts[k]);
  }
  peaks = pick(peaks, static_cast<int>(peaks.size()), removesMore);
  for (StabilityPoint& best : peaks) best = farthestFromFlanks(chart.limit, cuts, best);
  peaks = pick(peaks, static_cast<int>(peaks.size()), removesMore);  // some may now coincide
  chart.recommended = confirmed(std::move(peaks), size ? &*size : nullptr);
}

RiskOptions Recommendation::riskOptions() const {
  RiskOptions options;
  options.risk = parameters_.risk;
  options.speed_margin = parameters_.speed_margin;
  return options;
}

/// With edge forces and alike teeth; empty: size is not limited.
std::optional<SizeLimit> Recommendation::sizeLimit() const {
  if (parameters_.surface_tolerance == 0.0) return std::nullopt;
  const std::optional<UncertainSystem> uncertain = machine_.uncertainSystem(cut_);
  RegenerativeSystem system = uncertain->mean();
  const CuttingCoefficients& cutting = machine_.coefficients().value;
  system.chip.emplace();
  system.chip->feed = parameters_.feed_per_tooth;
  system.chip->kte = cutting.kte;
  system.chip->kre = cutting.kre;
  return SizeLimit(uncertain->about(system), parameters_.surface_tolerance, riskOptions());
}

/// The best of the peaks that make size and whose stability collocation confirms, since the zero-order
/// solution misses flips. A rejected point is tried again at a smaller depth, in the order of the reduced
/// removal rate.
std::vector<StabilityPoint> Recommendation::confirmed(std::vector<StabilityPoint> peaks,
                                                      const SizeLimit* size) const {
  const std::optional<UncertainSystem> uncertain = machine_.uncertainSystem(cut_);
  std::optional<DrawnMachines> machines;
  if (parameters_.risk > 0.0 && uncertain) machines.emplace(*uncertain, riskOptions());
  const bool mean_known =
      machine_.byCollocation(parameters_);  // the limits of the chart are from collocation already
  const auto isStable = [&](const StabilityPoint& cut) {
    if (size && !size->holds(cut.spindle_speed, cut.axial_depth)) return false;
    if (!machines) return true;
    const double depth = cut.axial_depth / (1.0 - parameters_.depth_margin);
    return (mean_known || machines->meanIsStable(cut.spindle_speed, depth)) &&
           machines->probability(cut.spindle_speed, cut.axial_depth).has_value();
  };
  std::stable_sort(peaks.begin(), peaks.end(), removesMore);
  std::map<double, double> least;  // [m] by speed
  for (const StabilityPoint& cut : peaks)
    least[cut.spindle_speed] = RECOMMENDATION.least_depth * cut.axial_depth;
  std::vector<StabilityPoint> found;
  while (!peaks.empty() && static_cast<int>(found.size()) < parameters_.recommended) {
    const StabilityPoint cut = peaks.front();
    peaks.erase(peaks.begin());
    if (isStable(cut)) {
      found.push_back(cut);
      continue;
    }
    const StabilityPoint reduced = load_.point(cut.spindle_speed, RECOMMENDATION.reduction * cut.axial_depth,
                                               cut.depth_limit, cut.chatter_frequency);
    if (reduced.axial_depth > least[reduced.spindle_speed])
      peaks.insert(std::upper_bound(peaks.begin(), peaks.end(), reduced, removesMore), reduced);
  }
  return found;
}

void Recommendation::proposeUnstable(StabilityChart& chart) const {
  const std::vector<double>& speeds = chart.limit.spindle_speed;
  const std::vector<double>& depth = chart.limit.depth;
  std::vector<StabilityPoint> valleys;
  for (std::size_t k = 1; k + 1 < speeds.size(); ++k) {
    if (!(depth[k] < depth[k - 1] && depth[k] <= depth[k + 1])) continue;
    const double highest = around(wide_, k + static_cast<std::size_t>(extraSpeeds(parameters_)),
                                  parameters_.speed_margin, std::greater<>());
    const double proposed = std::min(parameters_.unstable_factor * highest, permittedDepth(chart, k));
    if (!std::isfinite(proposed) || proposed < ChartParameters::CLEARLY_UNSTABLE * highest) continue;
    valleys.push_back(load_.point(speeds[k], proposed, depth[k], chart.limit.chatter_frequency[k]));
  }
  // A check close to the recommended cut is the most informative: nearly the same speed, another outcome.
  const double reference =
      chart.recommended.empty() ? speeds.back() : chart.recommended.front().spindle_speed;
  chart.unstable = pick(valleys, parameters_.unstable, [&](const StabilityPoint& a, const StabilityPoint& b) {
    return std::abs(std::log(a.spindle_speed / reference)) < std::abs(std::log(b.spindle_speed / reference));
  });
}

double Recommendation::permittedDepth(const StabilityChart& chart, std::size_t k) const {
  return std::min({parameters_.load_share * chart.torque_depth_limit[k],
                   parameters_.load_share * chart.power_depth_limit[k], parameters_.max_depth});
}

}  // namespace smartmill::stability
