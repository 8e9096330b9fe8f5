#include "smartmill_stability/solvers/solver.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "solvers/floquet.h"

namespace smartmill::stability {
namespace {

/// Search for the first loss of stability with growing depth.
struct DepthSearchOptions {
  double step = 0.15, least_step = 0.02;  ///< [1] of the depth: islands of instability are thicker
  /// [1] Step over the distance to the crossing that is extrapolated from the last two samples, so that the
  /// next sample lies beyond it.
  double overshoot = 1.3;
  int most_iterations = 60;      ///< of a root; false position needs about ten
  std::size_t mean_lines = 200;  ///< of the receptance for the first depth, which is a guess
  double first_share = 0.4;      ///< [1] first depth over the least zero-order limit, which misses flips
  double jump = 1.15;            ///< [1] over a neighbouring limit, above which the search is repeated
};
constexpr DepthSearchOptions SEARCH;

/// Logarithm of the spectral radius at a depth.
struct Sample {
  double depth, log_radius;
};

/// Search for the limit at one speed.
class Search {
 public:
  Search(FloquetSolver::AtSpeed& at, double tolerance) : at_(at), tolerance_(tolerance) {}

  double logRadius(double depth) { return std::log(std::max(1e-300, at_.multiplier(depth).radius())); }

  /// [m] First depth with a multiplier on the unit circle; +inf: none up to `most`. @param start [m] first
  /// depth
  double first(double start, double most) {
    std::vector<Sample> samples{{0.0, logRadius(0.0)}};
    double depth = std::min(start, most);
    for (;;) {
      samples.push_back({depth, logRadius(depth)});
      if (samples.size() >= 4) {
        // A lens of instability between two stable samples: the slopes are extrapolated from both sides.
        const Sample* s = &samples[samples.size() - 4];
        const double found = lens(s[0], s[1], s[2], s[3], 4);
        if (std::isfinite(found)) return found;
      }
      if (samples.back().log_radius > 0.0) return root(samples[samples.size() - 2], samples.back());
      if (depth >= most) return std::numeric_limits<double>::infinity();
      const Sample &a = samples[samples.size() - 2], &b = samples.back();
      const double slope = (b.log_radius - a.log_radius) / (b.depth - a.depth);
      const double step = slope > 0.0 ? -SEARCH.overshoot * b.log_radius / slope : SEARCH.step * depth;
      depth = std::min(depth + std::clamp(step, SEARCH.least_step * depth, SEARCH.step * depth), most);
    }
  }

  /// [m] Limit between a stable sample a and an unstable sample b.
  double root(Sample a, Sample b) {
    // Illinois method: false position, halving the value of an end that is retained twice.
    int replaced = 0;  // end replaced last: 1 b, -1 a
    double fa = a.log_radius, fb = b.log_radius;
    for (int i = 0; i < SEARCH.most_iterations && b.depth - a.depth > tolerance_ * b.depth; ++i) {
      double middle = (a.depth * fb - b.depth * fa) / (fb - fa);
      const double margin = 0.3 * tolerance_ * b.depth;
      middle = std::clamp(middle, a.depth + margin, b.depth - margin);
      const double f = logRadius(middle);
      if (f > 0.0) {
        b = {middle, f};
        fb = f;
        if (replaced == 1) fa *= 0.5;
        replaced = 1;
      } else {
        a = {middle, f};
        fa = f;
        if (replaced == -1) fb *= 0.5;
        replaced = -1;
      }
    }
    slope_ = (b.log_radius - a.log_radius) / (b.depth - a.depth);
    return (a.depth * b.log_radius - b.depth * a.log_radius) / (b.log_radius - a.log_radius);
  }

  double slope() const { return slope_; }  ///< [1/m] of the log radius at the limit

 private:
  /// [m] Start of a lens of instability between the stable samples b and c; +inf: none.
  double lens(const Sample& a, const Sample& b, const Sample& c, const Sample& d, int levels) {
    const double none = std::numeric_limits<double>::infinity();
    if (levels == 0 || b.log_radius > 0.0 || c.log_radius > 0.0) return none;
    const double rise = (b.log_radius - a.log_radius) / (b.depth - a.depth);
    const double fall = (d.log_radius - c.log_radius) / (d.depth - c.depth);
    if (!(rise > 0.0) || !(fall < 0.0)) return none;
    const double at = (c.log_radius - b.log_radius + rise * b.depth - fall * c.depth) / (rise - fall);
    if (!(at > b.depth) || !(at < c.depth) || b.log_radius + rise * (at - b.depth) <= 0.0) return none;
    const Sample middle{at, logRadius(at)};
    if (middle.log_radius > 0.0) return root(b, middle);
    const double left = lens(a, b, middle, c, levels - 1);
    return std::isfinite(left) ? left : lens(b, middle, c, d, levels - 1);
  }

  FloquetSolver::AtSpeed& at_;
  double tolerance_, slope_ = 1.0;
};

}  // namespace

const char* nameOf(Kind kind) {
  switch (kind) {
    case Kind::hopf:
      return "hopf";
    case Kind::flip:
      return "flip";
    case Kind::fold:
      return "fold";
    default:
      return "";
  }
}

Kind CharacteristicMultiplier::kind() const {
  // Tolerance: the splitting of a double eigenvalue by rounding.
  constexpr double REAL = 1e-5;
  if (std::abs(value.imag()) > REAL * std::abs(value)) return Kind::hopf;
  return value.real() < 0.0 ? Kind::flip : Kind::fold;
}

Method methodOf(const std::string& name) {
  for (const Method method :
       {Method::zero_order, Method::multi_frequency, Method::semi_discretization, Method::collocation})
    if (name == nameOf(method)) return method;
  throw Error("method " + name +
              ": expected collocation, semi_discretization, multi_frequency or zero_order");
}

const char* nameOf(Method method) {
  switch (method) {
    case Method::zero_order:
      return "zero_order";
    case Method::multi_frequency:
      return "multi_frequency";
    case Method::semi_discretization:
      return "semi_discretization";
    default:
      return "collocation";
  }
}

Axes::Axes(const std::vector<SystemMode>& modes) {
  for (std::size_t a = 0; a < 2; ++a) {
    const bool used = std::any_of(modes.begin(), modes.end(), [a](const SystemMode& mode) {
      return mode.output[a] != 0.0 || mode.input[a] != 0.0;
    });
    if (used) index.push_back(a);
  }
}

Eigen::MatrixXd Axes::reduced(const Eigen::Matrix2d& full) const {
  Eigen::MatrixXd small(count(), count());
  for (Eigen::Index p = 0; p < count(); ++p)
    for (Eigen::Index r = 0; r < count(); ++r)
      small(p, r) = full(static_cast<Eigen::Index>(index[static_cast<std::size_t>(p)]),
                         static_cast<Eigen::Index>(index[static_cast<std::size_t>(r)]));
  return small;
}

double highestOf(const RegenerativeSystem& system) {
  double highest = 0.0;
  for (const SystemMode& mode : system.modes) highest = std::max(highest, mode.frequency);
  return 1.5 * units::TWO_PI * highest;
}

std::vector<Limit> StabilitySolver::limits(const std::vector<double>& speeds, double max_depth) const {
  std::vector<Limit> found;
  found.reserve(speeds.size());
  for (const double speed : speeds) found.push_back(limit(speed, max_depth));
  return found;
}

FloquetSolver::FloquetSolver(const RegenerativeSystem& system, const SolverOptions& options)
    : system_(system), options_(options) {
  system_.validate();
  if (system_.modes.empty())
    throw Error(
        "stability: modes of the tool tip are missing: expected at least one (required by this method)");
  // Merritt's minimum for the full cutting coefficient is a lower bound of the limit (one mode); the mean
  // over an interrupted cut gives a larger one.
  double compliance = 0.0, highest = 0.0;
  for (const SystemMode& mode : system_.modes) {
    const double w = units::TWO_PI * mode.frequency;
    highest = std::max(highest, mode.frequency);
    compliance = std::max(compliance, std::hypot(mode.input[0], mode.input[1]) *
                                          std::hypot(mode.output[0], mode.output[1]) /
                                          (2.0 * mode.damping_ratio * w * w));
  }
  depth_scale_ = 0.5 / (std::hypot(system_.kt, system_.kr) * compliance);
  if (system_.edge.inclined())
    depth_scale_ *=
        std::hypot(system_.kt, system_.kr) / std::hypot(system_.kt, std::hypot(system_.kr, system_.ka));
  if (system_.cut == Cut::milling && system_.kt > 0.0) {
    const auto leastWith = [&](double kr) {
      const RegenerativeProcess mean{system_.teeth, system_.entry, std::min(system_.exit, units::TWO_PI),
                                     system_.kt, kr / system_.kt};
      return absoluteDepthLimit(mean, responseOf(system_.modes, 1.0, 2.0 * highest, SEARCH.mean_lines));
    };
    double least = depth_scale_;
    if (system_.exit <= units::TWO_PI) {
      least = leastWith(system_.meanRadial(depth_scale_));
      // The radial coefficient of an inclined edge changes with the depth: that of twice the height too.
      for (double depth = depth_scale_; system_.edge.inclined() && depth < least; depth *= 2.0)
        least = std::min(least, leastWith(system_.meanRadial(depth)));
    }
    if (std::isfinite(least)) depth_scale_ = std::max(depth_scale_, SEARCH.first_share * least);
  }
}

CharacteristicMultiplier FloquetSolver::multiplier(double speed, double depth) const {
  return at(speed)->multiplier(depth);
}

Limit FloquetSolver::limit(double speed, double max_depth) const {
  if (!(max_depth > 0.0)) throw Error("stability: largest depth: expected a value above 0");
  const std::unique_ptr<AtSpeed> here = at(speed);
  Search search(*here, options_.tolerance);
  const double depth = search.first(depth_scale_, max_depth);
  return std::isfinite(depth) ? describe(*here, speed, depth, search.slope()) : Limit();
}

Limit FloquetSolver::describe(AtSpeed& here, double speed, double depth, double slope) const {
  Limit limit;
  limit.depth = depth;
  // Just above the limit the multiplier that left the unit circle is the dominant one.
  const double above = depth * (1.0 + 10.0 * options_.tolerance);
  limit.kind = here.multiplier(above).kind();
  limit.frequency = here.chatterFrequency(above);
  if (options_.estimate_error)
    limit.error = std::abs(std::log(refined()->at(speed)->multiplier(depth).radius()) / slope);
  return limit;
}

std::vector<Limit> FloquetSolver::limits(const std::vector<double>& speeds, double max_depth) const {
  std::vector<Limit> found = StabilitySolver::limits(speeds, max_depth);
  // A lens of instability that the search missed at one speed lies near the limit of a neighbouring speed.
  const std::vector<Limit> before = found;
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (const std::size_t j : {i - 1, i + 1}) {
      if (j >= found.size() || !(before[i].depth > SEARCH.jump * before[j].depth)) continue;
      const std::unique_ptr<AtSpeed> here = at(speeds[i]);
      double stable = 0.9 * before[j].depth;
      if (here->multiplier(stable).radius() > 1.0) continue;
      for (const double share : {0.97, 1.0, 1.03, 1.08}) {
        const double depth = share * before[j].depth;
        if (depth >= found[i].depth) break;
        if (here->multiplier(depth).radius() > 1.0) {
          Search search(*here, options_.tolerance);
          const double limit =
              search.root({stable, search.logRadius(stable)}, {depth, search.logRadius(depth)});
          found[i] = describe(*here, speeds[i], limit, search.slope());
          break;
        }
        stable = depth;
      }
    }
  }
  return found;
}

std::unique_ptr<FloquetSolver> makeFloquetSolver(Method method, const RegenerativeSystem& system,
                                                 const SolverOptions& options) {
  if (!(options.tolerance > 0.0) || options.tolerance > 0.1)
    throw Error("tolerance: " + std::to_string(options.tolerance) + ": expected 0 < value <= 0.1");
  if (method == Method::collocation) return makeCollocation(system, options);
  if (system.variation)
    throw Error(std::string("method ") + nameOf(method) + ": speed variation: expected collocation");
  if (method == Method::semi_discretization) return makeSemiDiscretization(system, options);
  throw Error(std::string("method ") + nameOf(method) +
              ": no characteristic multipliers: expected collocation or semi_discretization");
}

std::unique_ptr<StabilitySolver> makeSolver(Method method, const RegenerativeSystem& system,
                                            const SolverOptions& options) {
  if (system.along_arc && (method == Method::zero_order || method == Method::multi_frequency))
    throw Error(std::string("method ") + nameOf(method) +
                ": coefficients along the arc: expected collocation or semi_discretization");
  if (!system.edge.helix.empty() && method == Method::zero_order)
    throw Error(std::string("method ") + nameOf(method) +
                ": a helix angle of each tooth (the delays change with height): expected collocation");
  if (system.variation && method != Method::collocation)
    throw Error(std::string("method ") + nameOf(method) + ": speed variation: expected collocation");
  if (method == Method::zero_order) return makeZeroOrder(system);
  if (method == Method::multi_frequency) return makeMultiFrequency(system, options);
  return makeFloquetSolver(method, system, options);
}

}  // namespace smartmill::stability
