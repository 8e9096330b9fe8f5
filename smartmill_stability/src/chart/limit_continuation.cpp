#include "smartmill_stability/chart/limit_continuation.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <future>
#include <optional>

#include "chart/limit_search.h"
#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "smartmill_stability/solvers/zero_order.h"

namespace smartmill::stability {
namespace {

/// Zero-order limits as a first guess; empty where that solution does not apply.
/// @param near lines on either side of each mode
StabilityLimit firstGuess(const RegenerativeSystem& system, const std::vector<double>& speeds, int near) {
  if (system.cut != Cut::milling || !system.evenPitch() || !(system.kt > 0.0) ||
      system.exit > units::TWO_PI + 1e-9)
    return {};
  // Lines are dense around each mode: with 60 the spacing is below a twentieth of its half-power bandwidth.
  constexpr double REACH = 20.0, LEAST = 50.0;
  double highest = 0.0;
  std::vector<double> lines;
  for (const SystemMode& mode : system.modes) {
    highest = std::max(highest, mode.frequency);
    for (int i = -near; i <= near; ++i) {
      const double share = static_cast<double>(i) / near;
      lines.push_back(mode.frequency * (1.0 + mode.damping_ratio * REACH * share * share * share));
    }
  }
  for (double f = LEAST; f < 1.5 * highest; f *= 1.0 + 1.2 / near) lines.push_back(f);
  std::sort(lines.begin(), lines.end());
  std::vector<double> frequencies;
  for (const double f : lines)
    if (f >= LEAST && (frequencies.empty() || f > frequencies.back())) frequencies.push_back(f);
  const ToolTipResponse response = responseOf(system.modes, std::move(frequencies));
  const auto limitWith = [&](double kr) {
    return zeroOrderLimit(
        {system.teeth, system.entry, std::min(system.exit, units::TWO_PI), system.kt, kr / system.kt},
        response, speeds);
  };
  if (!system.edge.inclined()) return limitWith(system.kr);
  const double least = absoluteDepthLimit(
      {system.teeth, system.entry, std::min(system.exit, units::TWO_PI), system.kt, system.kr / system.kt},
      response);
  return limitWith(system.meanRadial(std::isfinite(least) ? least : 1.0));
}

/// First guess of the limits, and lobes of chatter frequencies [Hz].
class GuessedLobes {
 public:
  /// @param teeth with even pitch; 0: uneven pitch
  GuessedLobes(const std::vector<double>& speeds, int teeth, StabilityLimit guess)
      : speeds_(speeds), teeth_(teeth), guess_(std::move(guess)) {}

  bool has(std::size_t i) const { return !guess_.depth.empty() && std::isfinite(guess_.depth[i]); }
  double depth(std::size_t i) const { return guess_.depth[i]; }
  double frequency(std::size_t i) const { return guess_.chatter_frequency[i]; }
  double leastDepth() const {
    double least = LimitKnot::NO_LIMIT;
    for (const double depth : guess_.depth) least = std::min(least, depth);
    return least;
  }
  /// Whether the first guess at i belongs to the lobe of a chatter frequency.
  bool fits(std::size_t i, double frequency) const {
    return has(i) && isClose(guess_.chatter_frequency[i], frequency, CONTINUATION.same_lobe);
  }
  /// Number of waves between two teeth; its integer part is the number of the lobe.
  double waves(std::size_t i, double frequency) const {
    return teeth_ > 0 ? frequency * units::TWO_PI / (teeth_ * speeds_[i]) : 0.0;
  }
  double lobe(std::size_t i, double frequency) const { return std::floor(waves(i, frequency)); }

 private:
  const std::vector<double>& speeds_;
  int teeth_;
  StabilityLimit guess_;
};

/// Calls work(0) .. work(count - 1), independent of each other, in two threads.
void inThreads(std::size_t count, const std::function<void(std::size_t)>& work) {
  std::atomic<std::size_t> next{0};
  const auto loop = [&] {
    for (std::size_t k = next++; k < count; k = next++) work(k);
  };
  auto other = std::async(std::launch::async, loop);
  loop();
  other.get();
}

/// Continuation of the first loss of stability over the speeds of a chart: evenly spaced speeds are searched
/// from depth zero, the speeds between start from a prediction by their neighbours and the first guess.
class LimitContinuation {
 public:
  LimitContinuation(const FloquetSolver& solver, const std::vector<double>& speeds, double max_depth,
                    const GuessedLobes& guess, const ContinuationAccuracy& accuracy)
      : search_(solver, max_depth, firstDepth(solver, guess), accuracy.tolerance),
        speeds_(speeds),
        guess_(guess),
        straight_(accuracy.straight),
        longest_(accuracy.longest),
        stride_(std::max(CONTINUATION.stride, speeds.size() / accuracy.searched)),
        knots_(speeds.size()) {}

  StabilityLimit run() {
    std::vector<std::size_t> seeds;
    for (std::size_t i = 0; i < speeds_.size(); i += stride_) seeds.push_back(i);
    if (seeds.back() + 1 != speeds_.size()) seeds.push_back(speeds_.size() - 1);
    inThreads(seeds.size(), [&](std::size_t k) { solve(seeds[k]); });
    inThreads(seeds.size() - 1, [&](std::size_t k) { fill(seeds[k], seeds[k + 1]); });
    const std::vector<std::size_t> uncertain = nearFlipLobes();
    inThreads(uncertain.size(), [&](std::size_t k) { correct(uncertain[k], knots_[uncertain[k]]); });
    StabilityLimit limit;
    limit.spindle_speed = speeds_;
    for (LimitKnot& knot : knots_) {
      // Extrapolated from a smaller depth, or interpolated.
      if (knot.depth > search_.maxDepth()) knot = LimitKnot();
      limit.depth.push_back(knot.depth);
      limit.chatter_frequency.push_back(knot.frequency);
    }
    return limit;
  }

 private:
  static double firstDepth(const FloquetSolver& solver, const GuessedLobes& guess) {
    const double least = guess.leastDepth();
    return std::isfinite(least) ? CONTINUATION.below * least : solver.firstDepth();
  }

  void solve(std::size_t i) { knots_[i] = search_.fromZero(speeds_[i]); }
  /// Solves for the limit near a prediction. @return false: there is none near it
  bool correct(std::size_t i, const LimitKnot& guess) {
    const std::optional<LimitKnot> found = search_.near(speeds_[i], guess);
    if (found) knots_[i] = *found;
    return found.has_value();
  }

  /// Interpolated speeds with an odd number of half waves between two teeth: a flip lobe as narrow as one
  /// speed may cut the flank of the lobe there.
  std::vector<std::size_t> nearFlipLobes() const {
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < knots_.size(); ++i)
      if (!knots_[i].solved && std::isfinite(knots_[i].depth) &&
          std::abs(guess_.waves(i, knots_[i].frequency) - guess_.lobe(i, knots_[i].frequency) - 0.5) <
              CONTINUATION.near_flip)
        found.push_back(i);
    return found;
  }

  /// Interpolation between a and b; where the first guess belongs to the same lobe, the ratio of limit to
  /// guess is interpolated.
  LimitKnot between(std::size_t a, std::size_t b, std::size_t i) const {
    const LimitKnot &from = knots_[a], &to = knots_[b];
    const double share = (speeds_[i] - speeds_[a]) / (speeds_[b] - speeds_[a]);
    LimitKnot knot;
    knot.kind = from.kind;
    knot.frequency = from.frequency + share * (to.frequency - from.frequency);
    knot.slope = from.slope + share * (to.slope - from.slope);
    knot.depth = from.depth + share * (to.depth - from.depth);
    if (guess_.fits(a, from.frequency) && guess_.fits(b, to.frequency) && guess_.fits(i, knot.frequency)) {
      const double at_a = from.depth / guess_.depth(a), at_b = to.depth / guess_.depth(b);
      knot.depth = guess_.depth(i) * (at_a + share * (at_b - at_a));
    }
    return knot;
  }

  /// Prediction where a and b belong to different lobes: the first guess, scaled by the ratio of limit to
  /// guess at the one in the same lobe.
  LimitKnot acrossLobes(std::size_t a, std::size_t b, std::size_t i) const {
    LimitKnot knot = std::isfinite(knots_[a].depth) ? knots_[a] : knots_[b];
    if (std::isfinite(knots_[a].depth) && std::isfinite(knots_[b].depth))
      knot.depth = std::sqrt(knots_[a].depth * knots_[b].depth);
    if (!guess_.has(i)) return knot;
    const double frequency = guess_.frequency(i);
    for (const std::size_t side : {a, b}) {
      if (!isClose(knots_[side].frequency, frequency, 0.1) || !guess_.fits(side, knots_[side].frequency))
        continue;
      knot = knots_[side];
      knot.depth *= guess_.depth(i) / guess_.depth(side);
      knot.frequency = frequency;
    }
    return knot;
  }

  /// Whether a and b are similar enough for interpolation between them.
  bool similar(std::size_t a, std::size_t b) const {
    const LimitKnot &from = knots_[a], &to = knots_[b];
    if (guess_.fits(a, from.frequency) && guess_.fits(b, to.frequency))
      return isClose(from.depth / guess_.depth(a), to.depth / guess_.depth(b), CONTINUATION.similar_ratio);
    return isClose(from.depth, to.depth, CONTINUATION.similar_depth);
  }

  bool oneLobe(std::size_t a, std::size_t b) const {
    const LimitKnot &from = knots_[a], &to = knots_[b];
    const double here = guess_.lobe(a, from.frequency);
    if (from.kind != to.kind || !isClose(from.frequency, to.frequency, CONTINUATION.same_lobe) ||
        here != guess_.lobe(b, to.frequency))
      return false;
    if (!guess_.fits(a, from.frequency) || !guess_.fits(b, to.frequency)) return true;
    for (std::size_t i = a + 1; i < b; ++i)
      if (guess_.has(i) && (!guess_.fits(i, from.frequency) || guess_.lobe(i, guess_.frequency(i)) != here))
        return false;
    return true;
  }

  /// Whether a and b are stable to the largest depth, and the speeds between them by the first guess.
  bool noneBetween(std::size_t a, std::size_t b) const {
    if (std::isfinite(knots_[a].depth) || std::isfinite(knots_[b].depth)) return false;
    for (std::size_t i = a + 1; i < b; ++i)
      if (guess_.has(i) && guess_.depth(i) < search_.maxDepth()) return false;
    return true;
  }

  void fill(std::size_t a, std::size_t b) {
    if (b - a < 2) return;
    const std::size_t middle = (a + b) / 2;
    if (noneBetween(a, b) && search_.isStableTo(speeds_[middle], search_.maxDepth())) return;
    const bool one = oneLobe(a, b);
    const LimitKnot predicted = one ? between(a, b, middle) : acrossLobes(a, b, middle);
    if (!correct(middle, predicted)) solve(middle);
    const LimitKnot& found = knots_[middle];
    if (middle - a > longest_ || !one || !similar(a, b) || found.kind != knots_[a].kind ||
        !isClose(found.depth, predicted.depth, straight_) ||
        !isClose(found.frequency, predicted.frequency, straight_)) {
      fill(a, middle);
      fill(middle, b);
      return;
    }
    for (const auto& [from, to] : {std::pair{a, middle}, {middle, b}})
      for (std::size_t i = from + 1; i < to; ++i) knots_[i] = between(from, to, i);
  }

  LimitSearch search_;
  const std::vector<double>& speeds_;
  const GuessedLobes& guess_;
  double straight_;      // [1]
  std::size_t longest_;  // from one solved speed to the next
  std::size_t stride_;   // of the speeds that are searched from depth zero
  std::vector<LimitKnot> knots_;
};

}  // namespace

StabilityLimit limitsByContinuation(const RegenerativeSystem& system, const std::vector<double>& speeds,
                                    double max_depth, const ContinuationAccuracy& accuracy) {
  if (speeds.size() < 2) throw Error("stability limits: expected at least two speeds");
  SolverOptions options = SolverOptions::ofManyPoints();
  options.nodes = accuracy.nodes;
  options.tolerance = accuracy.tolerance;
  const GuessedLobes guess(speeds, system.evenPitch() ? system.teeth : 0,
                           firstGuess(system, speeds, accuracy.lines));
  return LimitContinuation(*makeFloquetSolver(Method::collocation, system, options), speeds, max_depth, guess,
                           accuracy)
      .run();
}

}  // namespace smartmill::stability
