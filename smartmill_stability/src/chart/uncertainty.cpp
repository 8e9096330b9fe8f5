#include "smartmill_stability/chart/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"

namespace smartmill::stability {
namespace {

/// Log-normal factor with mean 1 and a standard deviation of `share`.
double factor(std::mt19937_64& random, double share) {
  std::normal_distribution<double> normal;
  const double variance = std::log1p(share * share);
  return std::exp(std::sqrt(variance) * normal(random) - 0.5 * variance);
}

double share(double std_dev, double value, double fallback_percent) {
  return std::isfinite(std_dev) && value != 0.0 ? std::abs(std_dev / value) : 0.01 * fallback_percent;
}

}  // namespace

UncertainSystem::UncertainSystem(const RegenerativeSystem& system, std::vector<ModeUncertainty> modes,
                                 double kt_share, double kr_share)
    : system_(system), modes_(std::move(modes)), kt_share_(kt_share), kr_share_(kr_share) {
  system_.validate();
  if (modes_.size() != system_.modes.size())
    throw Error("uncertainty: standard deviations of " + std::to_string(modes_.size()) + " modes: expected " +
                std::to_string(system_.modes.size()));
  for (const ModeUncertainty& m : modes_)
    for (const double value : {m.frequency, m.damping, m.gain, kt_share, kr_share})
      if (!(value >= 0.0) || !(value < 1.0))
        throw Error("uncertainty: relative standard deviation " + std::to_string(value) +
                    ": expected 0 <= value < 1");
}

UncertainSystem UncertainSystem::of(const MachineModel& model, const RegenerativeSystem& system) {
  const Uncertainty& u = model.uncertainty;
  std::vector<ModeUncertainty> modes;
  const WorkpieceModes workpiece = model.workpieceModes();
  for (const ModalModel* axis : {&model.tool_tip.x, &model.tool_tip.y, &workpiece.x, &workpiece.y})
    for (const Mode& mode : axis->modes)
      modes.push_back({share(mode.frequency_std, mode.frequency, u.frequency),
                       share(mode.damping_ratio_std, mode.damping_ratio, u.damping),
                       share(mode.gain_std, mode.gain, u.stiffness)});
  const CuttingCoefficients& cutting = model.needCutting("predict stability");
  const double none = std::numeric_limits<double>::quiet_NaN();
  const double kt_std = model.cutting_std ? model.cutting_std->ktc : none;
  const double kr_std = model.cutting_std ? model.cutting_std->krc : none;
  return {system, modes, share(kt_std, cutting.ktc, u.cutting), share(kr_std, cutting.krc, u.cutting)};
}

RegenerativeSystem UncertainSystem::draw(std::mt19937_64& random) const {
  std::normal_distribution<double> normal;
  RegenerativeSystem drawn = system_;
  for (std::size_t k = 0; k < modes_.size(); ++k) {
    SystemMode& mode = drawn.modes[k];
    // Limited to four standard deviations, so that the frequency stays positive.
    const double off = std::clamp(normal(random), -4.0, 4.0) * modes_[k].frequency;
    const double frequency = std::max(0.05, 1.0 + off);
    mode.frequency *= frequency;
    mode.damping_ratio = std::min(0.99, mode.damping_ratio * factor(random, modes_[k].damping));
    // Both vectors are proportional to w sqrt(gain).
    const double size = frequency * std::sqrt(factor(random, modes_[k].gain));
    for (std::size_t a = 0; a < 2; ++a) {
      mode.input[a] *= size;
      mode.output[a] *= size;
    }
  }
  drawn.kt *= factor(random, kt_share_);
  const double radial = factor(random, kr_share_);
  drawn.kr *= radial;
  drawn.ka *= radial;  // of an inclined edge: both act across the tool
  return drawn;
}

double chatterProbability(const UncertainSystem& system, double speed, double depth, int draws, unsigned seed,
                          Method method) {
  if (draws < 1) throw Error("draws: " + std::to_string(draws) + ": expected at least 1");
  std::mt19937_64 random(seed);
  int unstable = 0;
  for (int i = 0; i < draws; ++i)
    unstable += makeFloquetSolver(method, system.draw(random))->multiplier(speed, depth).radius() > 1.0;
  return static_cast<double>(unstable) / draws;
}

ProbabilityChart probabilityChart(const UncertainSystem& system, const std::vector<double>& speeds,
                                  const std::vector<double>& depths, int draws, unsigned seed,
                                  const std::function<void(double)>& progress) {
  if (speeds.empty() || depths.empty())
    throw Error("probability chart: expected at least one speed and one depth");
  if (draws < 1) throw Error("draws: " + std::to_string(draws) + ": expected at least 1");
  ProbabilityChart chart;
  chart.speeds = speeds;
  chart.depths = depths;
  chart.probability.assign(speeds.size(), std::vector<double>(depths.size(), 0.0));
  SolverOptions options;
  options.tolerance = 1e-3;  // far below the scatter of the draws
  const double most = *std::max_element(depths.begin(), depths.end());
  for (const Limit& limit : makeSolver(Method::collocation, system.mean(), options)->limits(speeds, most))
    chart.nominal.push_back(limit.depth);
  std::mt19937_64 random(seed);
  for (int i = 0; i < draws; ++i) {
    const auto solver = makeSolver(Method::collocation, system.draw(random), options);
    for (std::size_t s = 0; s < speeds.size(); ++s) {
      const double limit = solver->limit(speeds[s], most).depth;
      for (std::size_t d = 0; d < depths.size(); ++d)
        if (depths[d] > limit) chart.probability[s][d] += 1.0 / draws;
    }
    if (progress) progress((i + 1.0) / draws);
  }
  return chart;
}

std::vector<RobustPoint> robustPoints(const ProbabilityChart& chart, double risk, double speed_margin,
                                      int count) {
  std::vector<RobustPoint> points;
  for (std::size_t s = 0; s < chart.speeds.size(); ++s) {
    const double speed = chart.speeds[s];
    // Beyond the chart the probability is unknown.
    if (speed * (1.0 - speed_margin) < chart.speeds.front() ||
        speed * (1.0 + speed_margin) > chart.speeds.back())
      continue;
    RobustPoint best;
    for (std::size_t d = 0; d < chart.depths.size(); ++d) {
      double worst = 0.0;
      for (std::size_t k = 0; k < chart.speeds.size(); ++k)
        if (std::abs(chart.speeds[k] - speed) <= speed_margin * speed * (1.0 + 1e-12))
          worst = std::max(worst, chart.probability[k][d]);
      if (worst > risk) break;
      best = {speed, chart.depths[d], worst};
    }
    if (best.depth > 0.0) points.push_back(best);
  }
  std::stable_sort(points.begin(), points.end(), [](const RobustPoint& a, const RobustPoint& b) {
    return a.speed * a.depth > b.speed * b.depth;
  });
  constexpr double POCKET = 0.05;
  std::vector<RobustPoint> chosen;
  for (const RobustPoint& p : points) {
    if (static_cast<int>(chosen.size()) >= count) break;
    if (std::none_of(chosen.begin(), chosen.end(),
                     [&](const RobustPoint& c) { return std::abs(p.speed / c.speed - 1.0) < POCKET; }))
      chosen.push_back(p);
  }
  return chosen;
}

}  // namespace smartmill::stability
