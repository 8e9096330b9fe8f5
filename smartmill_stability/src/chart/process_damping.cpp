#include "smartmill_stability/chart/process_damping.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <boost/math/tools/minima.hpp>

#include "smartmill_core/error.h"
#include "smartmill_core/math/normal.h"
#include "smartmill_core/require.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/chart/risk.h"
#include "smartmill_stability/chart/uncertainty.h"

namespace smartmill::stability {
namespace {

struct GridOptions {
  double ratio = 1.08;  ///< [1] of the grid: linear interpolation of the log limits is right to 0.3 %
  int count = 140;      ///< [1] coefficients above 0: a factor of 4e4
  double first = 0.01;  ///< [1] over the coefficient that doubles the damping at the lowest speed
  int coarse = 10;      ///< [1] grid steps between the positions of the first scan
  /// [1] Deepest limit over the deepest cut: five standard deviations of a scatter and scale of 0.1 each.
  double beyond = 2.0;
  double probability = 1e-9;  ///< [1] least probability of a verdict, so that one wrong entry does not decide
  int draws = 100;            ///< machines for the standard deviation of the scale
  double surely_wrong = 3.0;  ///< [scatters]
  double least_log_likelihood = 8.0;  ///< below the maximum: less has no share in the standard deviation
  int parts = 100;                    ///< of the coefficients between, for the standard deviation
};
constexpr GridOptions GRID;

/// Position of the maximum of a function with one maximum between low and high.
double maximumOf(const std::function<double(double)>& function, double low, double high) {
  constexpr int BITS = 20;  // relative 1e-6
  return boost::math::tools::brent_find_minima([&](double x) { return -function(x); }, low, high, BITS).first;
}

/// Position between an inner one above a level and an outer one below it at which a function crosses it.
double crossing(const std::function<double(double)>& function, double level, double inner, double outer) {
  constexpr double CLOSE = 1e-3;  // [grid steps]
  while (std::abs(outer - inner) > CLOSE) {
    const double middle = 0.5 * (inner + outer);
    (function(middle) > level ? inner : outer) = middle;
  }
  return 0.5 * (inner + outer);
}

}  // namespace

void ProcessDampingOptions::validate() const {
  require("scatter of a limit [1]", scatter, Range::openLow(0.0, 0.5));
  require("standard deviation of the limits [1]", scale_std, Range::openHigh(0.0, 0.5));
}

ProcessDampingChart::ProcessDampingChart(const RegenerativeSystem& system, const std::vector<JudgedCut>& cuts)
    : system_(system) {
  if (cuts.empty()) throw Error("process damping: expected at least one cut");
  double slowest = cuts.front().speed, deepest = 0.0;
  for (const JudgedCut& cut : cuts) {
    require("spindle speed of a cut [rad/s]", cut.speed, Range::positive());
    require("depth of a cut [m]", cut.depth, Range::positive());
    slowest = std::min(slowest, cut.speed);
    deepest = std::max(deepest, cut.depth);
  }
  max_depth_ = GRID.beyond * deepest;
  // Damping constant 2 zeta w / (input output) of the most compliant mode; process damping C b / v.
  double damping = 0.0, most_compliant = 0.0;
  for (const SystemMode& mode : system.modes) {
    const double w = units::TWO_PI * mode.frequency;
    const double mobility =
        std::hypot(mode.input[0], mode.input[1]) * std::hypot(mode.output[0], mode.output[1]);
    if (mobility / (w * w) <= most_compliant) continue;
    most_compliant = mobility / (w * w);
    damping = 2.0 * mode.damping_ratio * w / mobility;
  }
  first_ = GRID.first * damping * 0.5 * system.diameter * slowest / deepest;
  require("coefficient of process damping from modes and diameter [N/m]", first_, Range::positive());
}

/// [N/m] Coefficient at a position [grid steps]: linear to the first one, then geometric.
double ProcessDampingChart::valueAt(double position) const {
  return position < 1.0 ? position * first_ : first_ * std::pow(GRID.ratio, position - 1.0);
}

double ProcessDampingChart::positionAt(double coefficient) const {
  return coefficient < first_ ? coefficient / first_
                              : 1.0 + std::log(coefficient / first_) / std::log(GRID.ratio);
}

double ProcessDampingChart::logLimitAt(int index, double speed) {
  std::map<double, double>& known = log_limits_[index];
  const auto found = known.find(speed);
  if (found != known.end()) return found->second;
  RegenerativeSystem damped = system_;
  damped.setProcessDamping(valueAt(index));
  SolverOptions options = SolverOptions::ofManyPoints();
  options.many = false;  // a table of responses takes longer than the few limits
  const double depth = makeSolver(Method::collocation, damped, options)->limit(speed, max_depth_).depth;
  return known[speed] = std::log(std::min(depth, max_depth_));
}

/// Interpolated between the grid. @param position [grid steps]
double ProcessDampingChart::logLimit(double speed, double position) {
  const int index = std::min(static_cast<int>(position), GRID.count - 1);
  const double share = position - index;
  const double low = logLimitAt(index, speed);
  return share > 0.0 ? low + share * (logLimitAt(index + 1, speed) - low) : low;
}

double ProcessDampingChart::limit(double speed, double coefficient) {
  require("coefficient of process damping [N/m]", coefficient, Range::closed(0.0, valueAt(GRID.count)));
  return std::exp(logLimit(speed, positionAt(coefficient)));
}

ProcessDampingChart::Marginal ProcessDampingChart::marginal(const std::vector<JudgedCut>& cuts,
                                                            const ProcessDampingOptions& options,
                                                            double position) {
  std::vector<double> above;  // log(depth / limit)
  for (const JudgedCut& cut : cuts) above.push_back(std::log(cut.depth) - logLimit(cut.speed, position));
  const auto logLikelihood = [&](double log_scale) {
    double sum = 0.0;
    for (std::size_t i = 0; i < cuts.size(); ++i) {
      const double distance = (above[i] - log_scale) / options.scatter;
      sum += std::log(std::max(GRID.probability, normalCdf(cuts[i].chatter ? distance : -distance)));
    }
    return sum;
  };
  if (options.scale_std == 0.0) return {logLikelihood(0.0), 0.0};
  constexpr double REACH = 4.0;  // [1] of the standard deviation
  constexpr int STEPS = 80;      // of the trapezoidal rule, which converges fast for smooth peaks
  std::vector<double> scale, value;
  for (int i = 0; i <= STEPS; ++i) {
    const double deviations = REACH * (2.0 * i / STEPS - 1.0);
    scale.push_back(deviations * options.scale_std);
    value.push_back(logLikelihood(scale.back()) - 0.5 * deviations * deviations);
  }
  const double most = *std::max_element(value.begin(), value.end());
  double sum = 0.0, moment = 0.0;
  for (std::size_t i = 0; i < value.size(); ++i) {
    const double share = std::exp(value[i] - most);
    sum += share;
    moment += share * scale[i];
  }
  return {most + std::log(sum), moment / sum};
}

ProcessDampingEstimate ProcessDampingChart::estimate(const std::vector<JudgedCut>& cuts,
                                                     const ProcessDampingOptions& options) {
  options.validate();
  const auto likelihood = [&](double position) { return marginal(cuts, options, position).log_likelihood; };
  std::vector<double> scan;
  for (int i = 0; i <= GRID.count; i += GRID.coarse) scan.push_back(likelihood(i));
  const auto top = static_cast<int>(std::max_element(scan.begin(), scan.end()) - scan.begin());
  const int last = static_cast<int>(scan.size()) - 1;
  const auto positionOf = [](int i) { return static_cast<double>(i) * GRID.coarse; };
  double best = maximumOf(likelihood, positionOf(std::max(0, top - 1)), positionOf(std::min(last, top + 1)));
  if (likelihood(0.0) >= likelihood(best)) best = 0.0;
  const Marginal found = marginal(cuts, options, best);
  // Coefficients whose likelihood matters.
  const double level = found.log_likelihood - GRID.least_log_likelihood;
  int above = static_cast<int>(std::ceil(best / GRID.coarse)), below = static_cast<int>(best / GRID.coarse);
  while (above <= last && scan[static_cast<std::size_t>(above)] > level) ++above;
  if (above > last)
    throw Error(
        "process damping: no upper bound: expected cuts with chatter at speeds where process damping raises "
        "the "
        "limit");
  while (below >= 0 && scan[static_cast<std::size_t>(below)] > level) --below;
  const double low = below < 0 ? 0.0 : valueAt(crossing(likelihood, level, best, positionOf(below))),
               high = valueAt(crossing(likelihood, level, best, positionOf(above)));
  ProcessDampingEstimate estimate;
  estimate.coefficient = valueAt(best);
  double sum = 0.0, square = 0.0;
  for (int i = 0; i <= GRID.parts; ++i) {
    const double coefficient = low + (high - low) * i / GRID.parts;
    const double weight = (i == 0 || i == GRID.parts ? 0.5 : 1.0) *
                          std::exp(likelihood(positionAt(coefficient)) - found.log_likelihood);
    sum += weight;
    square += weight * std::pow(coefficient - estimate.coefficient, 2);
  }
  estimate.std_dev = std::sqrt(square / sum);
  estimate.scale = std::exp(found.log_scale);
  for (const JudgedCut& cut : cuts) {
    const double distance =
        (std::log(cut.depth) - logLimit(cut.speed, best) - found.log_scale) / options.scatter;
    estimate.contradictions += (cut.chatter ? -distance : distance) > GRID.surely_wrong;
  }
  return estimate;
}

MachineModel withProcessDamping(MachineModel model, const ProcessDampingEstimate& estimate) {
  constexpr const char* KEY = "coefficient_n_per_mm";
  EffectEntry effect;
  effect.name = "process_damping";
  effect.numbers[KEY] = estimate.coefficient / units::N_PER_MM;
  effect.std_devs[KEY] = estimate.std_dev / units::N_PER_MM;
  std::vector<EffectEntry>& effects = model.effects;
  effects.erase(std::remove_if(effects.begin(), effects.end(),
                               [&](const EffectEntry& other) { return other.name == effect.name; }),
                effects.end());
  effects.push_back(effect);
  return model;
}

double limitScaleStd(const MachineModel& model, const RegenerativeSystem& system,
                     const std::vector<JudgedCut>& cuts) {
  std::vector<double> speeds;
  for (const JudgedCut& cut : cuts) speeds.push_back(cut.speed);
  std::sort(speeds.begin(), speeds.end());
  speeds.erase(std::unique(speeds.begin(), speeds.end()), speeds.end());
  const DrawnLimits limits = drawnLimits(UncertainSystem::of(model, system), speeds, GRID.draws, 1);
  std::vector<double> scales;
  for (const std::vector<double>& drawn : limits.drawn) {
    double sum = 0.0;
    int count = 0;
    for (std::size_t k = 0; k < speeds.size(); ++k) {
      if (!std::isfinite(drawn[k]) || !std::isfinite(limits.mean[k])) continue;
      sum += std::log(drawn[k] / limits.mean[k]);
      ++count;
    }
    if (count > 0) scales.push_back(sum / count);
  }
  return standardDeviation(scales);
}

}  // namespace smartmill::stability
