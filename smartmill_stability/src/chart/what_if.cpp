#include "smartmill_stability/chart/what_if.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <functional>
#include <future>

#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

constexpr double NO_LIMIT = std::numeric_limits<double>::infinity();

/// Whether two numbers differ by at most a relative amount.
bool close(double a, double b, double share) {
  return std::abs(a - b) <= share * std::min(std::abs(a), std::abs(b));
}

/// Zero-order limits as a first guess; empty where that solution does not apply.
StabilityLimit firstGuess(const RegenerativeSystem& system, const std::vector<double>& speeds) {
  if (system.cut != Cut::milling || !system.evenPitch() || !(system.kt > 0.0) ||
      system.exit > units::TWO_PI + 1e-9)
    return {};
  // Lines are dense around each mode: spacing below a twentieth of its half-power bandwidth.
  constexpr int NEAR = 60;
  constexpr double REACH = 20.0, LEAST = 50.0;
  double highest = 0.0;
  std::vector<double> lines;
  for (const SystemMode& mode : system.modes) {
    highest = std::max(highest, mode.frequency);
    for (int i = -NEAR; i <= NEAR; ++i) {
      const double share = static_cast<double>(i) / NEAR;
      lines.push_back(mode.frequency * (1.0 + mode.damping_ratio * REACH * share * share * share));
    }
  }
  for (double f = LEAST; f < 1.5 * highest; f *= 1.02) lines.push_back(f);
  std::sort(lines.begin(), lines.end());
  ToolTipResponse response;
  for (const double f : lines) {
    if (f < LEAST || (!response.frequency.empty() && f <= response.frequency.back())) continue;
    const auto g = receptance(system.modes, f);
    response.frequency.push_back(f);
    response.xx.push_back(g[0]);
    response.xy.push_back(g[1]);
    response.yx.push_back(g[2]);
    response.yy.push_back(g[3]);
  }
  const RegenerativeProcess mean{system.teeth, system.entry, std::min(system.exit, units::TWO_PI), system.kt,
                                 system.kr / system.kt};
  return zeroOrderLimit(mean, response, speeds);
}

/// Continuation of the first loss of stability over the speeds of a chart: every STRIDE-th speed is searched
/// from depth zero, the speeds between start from a prediction by their neighbours and the first guess.
class LimitContinuation {
 public:
  /// @param teeth with even pitch; 0: uneven pitch
  LimitContinuation(const FloquetSolver& solver, const std::vector<double>& speeds, double max_depth,
                    int teeth, StabilityLimit guess)
      : solver_(solver),
        max_depth_(max_depth),
        teeth_(teeth),
        speeds_(speeds),
        guess_(std::move(guess)),
        knots_(speeds.size()) {
    start_ = max_depth_;
    for (const double depth : guess_.depth) start_ = std::min(start_, BELOW * depth);
  }

  StabilityLimit run() {
    std::vector<std::size_t> seeds;
    for (std::size_t i = 0; i < speeds_.size(); i += STRIDE) seeds.push_back(i);
    if (seeds.back() + 1 != speeds_.size()) seeds.push_back(speeds_.size() - 1);
    inThreads(seeds.size(), [&](std::size_t k) { search(seeds[k]); });
    inThreads(seeds.size() - 1, [&](std::size_t k) { fill(seeds[k], seeds[k + 1]); });
    const std::vector<std::size_t> uncertain = nearFlipLobes();
    inThreads(uncertain.size(), [&](std::size_t k) { correct(uncertain[k], knots_[uncertain[k]]); });
    StabilityLimit limit;
    limit.spindle_speed = speeds_;
    for (const Knot& knot : knots_) {
      limit.depth.push_back(knot.depth);
      limit.chatter_frequency.push_back(knot.frequency);
    }
    return limit;
  }

 private:
  static constexpr std::size_t STRIDE = 10;
  static constexpr double BELOW = 0.6;       // first depth of a search over the least first guess
  static constexpr double GROWTH = 1.25;     // of the depth in a search
  static constexpr double TOLERANCE = 1e-3;  // relative, of a depth
  static constexpr double SAME_LOBE = 0.03;  // relative difference of the chatter frequency
  static constexpr double STRAIGHT = 0.01;   // relative error of a prediction that permits interpolation

  struct Knot {
    double depth = NO_LIMIT;
    double frequency = std::numeric_limits<double>::quiet_NaN();  // [Hz]
    double slope = 1.0;  // d log(spectral radius) / d log(depth) at the limit
    Kind kind = Kind::none;
    bool solved = false;  // false: interpolated
  };

  /// Dominant multiplier at a depth.
  struct Sample {
    double depth = 0.0, log_radius = 0.0;
    CharacteristicMultiplier multiplier;
  };

  /// Calls work(0) .. work(count - 1), independent of each other, in two threads.
  static void inThreads(std::size_t count, const std::function<void(std::size_t)>& work) {
    std::atomic<std::size_t> next{0};
    const auto loop = [&] {
      for (std::size_t k = next++; k < count; k = next++) work(k);
    };
    auto other = std::async(std::launch::async, loop);
    loop();
    other.get();
  }

  static Sample sampleOf(FloquetSolver::AtSpeed& here, double depth) {
    Sample sample{depth, 0.0, here.multiplier(depth)};
    sample.log_radius = std::log(std::max(1e-300, sample.multiplier.radius()));
    return sample;
  }

  static double slopeOf(const Sample& a, const Sample& b) {
    return (b.log_radius - a.log_radius) / std::log(b.depth / a.depth);
  }

  /// Search from depth zero, in larger steps than FloquetSolver::limit().
  void search(std::size_t i) {
    const auto here = solver_.at(speeds_[i]);
    constexpr int MOST = 8;
    Sample low = sampleOf(*here, std::min(start_, max_depth_)), high = low;
    for (int k = 0; k < MOST && low.log_radius > 0.0; ++k) {
      high = low;
      low = sampleOf(*here, 0.5 * low.depth);
    }
    double slope = 0.0;
    while (high.log_radius <= 0.0 && low.depth < max_depth_) {
      constexpr double OVERSHOOT = 1.2, LEAST = 1.04;
      const double predicted = slope > 0.0 ? std::exp(-OVERSHOOT * low.log_radius / slope) : GROWTH;
      high = sampleOf(*here, std::min(max_depth_, low.depth * std::clamp(predicted, LEAST, GROWTH)));
      slope = slopeOf(low, high);
      if (high.log_radius <= 0.0) low = high;
    }
    if (high.log_radius > 0.0) knots_[i] = refined(*here, low, high, NO_LIMIT);
  }

  /// Limit between a stable and an unstable depth. @param frequency [Hz] expected; not finite: unknown
  static Knot refined(FloquetSolver::AtSpeed& here, Sample low, Sample high, double frequency) {
    constexpr int MOST = 12;
    for (int k = 0; k < MOST && high.depth > (1.0 + TOLERANCE) * low.depth; ++k) {
      const double share = -low.log_radius / (high.log_radius - low.log_radius);
      const Sample middle =
          sampleOf(here, low.depth * std::pow(high.depth / low.depth, std::clamp(share, 0.03, 0.97)));
      const double off = std::abs(middle.log_radius / slopeOf(low, high));
      (middle.log_radius > 0.0 ? high : low) = middle;
      if (off < TOLERANCE) return knotAt(here, middle, slopeOf(low, high), frequency);
    }
    return knotAt(here, high, slopeOf(low, high), frequency);
  }

  /// The limit from a sample close to it.
  static Knot knotAt(FloquetSolver::AtSpeed& here, const Sample& sample, double slope, double frequency) {
    Knot knot;
    knot.solved = true;
    knot.slope = slope;
    knot.kind = sample.multiplier.kind();
    knot.depth = sample.depth * std::exp(-sample.log_radius / slope);
    // The motion contains the frequency of the multiplier plus all multiples of that of the period.
    const double step = 1.0 / sample.multiplier.period;
    const double base = std::abs(std::arg(sample.multiplier.value)) / units::TWO_PI * step;
    for (const double sign : {1.0, -1.0}) {
      const double nearest = sign * base + step * std::round((frequency - sign * base) / step);
      if (close(nearest, frequency, SAME_LOBE) &&
          !(std::abs(knot.frequency - frequency) < std::abs(nearest - frequency)))
        knot.frequency = nearest;
    }
    if (std::isnan(knot.frequency)) knot.frequency = here.chatterFrequency((1.0 + TOLERANCE) * knot.depth);
    return knot;
  }

  /// Solves for the limit near a prediction. @return false: there is none near it
  bool correct(std::size_t i, const Knot& guess) {
    constexpr int MOST = 5;
    constexpr double NEAR = 0.003, CLOSE_BY = 0.03, FAR = 0.2, REACH = 1.4, LEAST_SLOPE = 0.05;
    if (!(guess.depth > 0.0) || guess.depth > max_depth_) return false;
    const auto here = solver_.at(speeds_[i]);
    const Sample first = sampleOf(*here, guess.depth);
    double slope = std::max(LEAST_SLOPE, guess.slope);
    if (std::abs(first.log_radius) <= NEAR * slope) {
      knots_[i] = knotAt(*here, first, slope, guess.frequency);
      return true;
    }
    const double step = std::exp(std::clamp(-first.log_radius / slope, -FAR, FAR));
    const Sample second = sampleOf(*here, std::min(max_depth_, step * guess.depth));
    slope = slopeOf(first, second);
    if (slope > LEAST_SLOPE && std::abs(second.log_radius) <= CLOSE_BY * slope * std::abs(step - 1.0)) {
      knots_[i] = knotAt(*here, second, slope, guess.frequency);
      return true;
    }
    Sample low = first.depth < second.depth ? first : second,
           high = first.depth < second.depth ? second : first;
    double reach = 1.05;
    for (int k = 0; k < MOST && low.log_radius > 0.0; ++k, reach = std::min(reach * reach, REACH)) {
      high = low;
      low = sampleOf(*here, low.depth / reach);
    }
    for (int k = 0; k < MOST && high.log_radius <= 0.0; ++k, reach = std::min(reach * reach, REACH)) {
      if (high.depth >= max_depth_) return false;
      low = high;
      high = sampleOf(*here, std::min(max_depth_, reach * high.depth));
    }
    if (low.log_radius > 0.0 || high.log_radius <= 0.0) return false;
    knots_[i] = refined(*here, low, high, guess.frequency);
    return true;
  }

  bool guessed(std::size_t i) const { return !guess_.depth.empty() && std::isfinite(guess_.depth[i]); }

  /// Whether the first guess at i belongs to the lobe of a chatter frequency [Hz].
  bool guessFits(std::size_t i, double frequency) const {
    return guessed(i) && close(guess_.chatter_frequency[i], frequency, SAME_LOBE);
  }

  /// Interpolated speeds with an odd number of half waves between two teeth: a flip lobe as narrow as one
  /// speed may cut the flank of the lobe there.
  std::vector<std::size_t> nearFlipLobes() const {
    constexpr double NEAR = 0.03;
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < knots_.size(); ++i)
      if (!knots_[i].solved && std::isfinite(knots_[i].depth) &&
          std::abs(waves(i, knots_[i].frequency) - lobe(i, knots_[i].frequency) - 0.5) < NEAR)
        found.push_back(i);
    return found;
  }

  /// Interpolation between a and b; where the first guess belongs to the same lobe, the ratio of limit to
  /// guess is interpolated.
  Knot between(std::size_t a, std::size_t b, std::size_t i) const {
    const Knot &from = knots_[a], &to = knots_[b];
    const double share = (speeds_[i] - speeds_[a]) / (speeds_[b] - speeds_[a]);
    Knot knot;
    knot.kind = from.kind;
    knot.frequency = from.frequency + share * (to.frequency - from.frequency);
    knot.slope = from.slope + share * (to.slope - from.slope);
    knot.depth = from.depth + share * (to.depth - from.depth);
    if (guessFits(a, from.frequency) && guessFits(b, to.frequency) && guessFits(i, knot.frequency)) {
      const double at_a = from.depth / guess_.depth[a], at_b = to.depth / guess_.depth[b];
      knot.depth = guess_.depth[i] * (at_a + share * (at_b - at_a));
    }
    return knot;
  }

  /// Prediction where a and b belong to different lobes: the first guess, scaled by the ratio of limit to
  /// guess at the one in the same lobe.
  Knot acrossLobes(std::size_t a, std::size_t b, std::size_t i) const {
    Knot knot = std::isfinite(knots_[a].depth) ? knots_[a] : knots_[b];
    if (std::isfinite(knots_[a].depth) && std::isfinite(knots_[b].depth))
      knot.depth = std::sqrt(knots_[a].depth * knots_[b].depth);
    if (!guessed(i)) return knot;
    const double frequency = guess_.chatter_frequency[i];
    for (const std::size_t side : {a, b}) {
      if (!close(knots_[side].frequency, frequency, 0.1) || !guessFits(side, knots_[side].frequency))
        continue;
      knot = knots_[side];
      knot.depth *= guess_.depth[i] / guess_.depth[side];
      knot.frequency = frequency;
    }
    return knot;
  }

  /// Number of waves between two teeth; its integer part is the number of the lobe.
  double waves(std::size_t i, double frequency) const {
    return teeth_ > 0 ? frequency * units::TWO_PI / (teeth_ * speeds_[i]) : 0.0;
  }
  double lobe(std::size_t i, double frequency) const { return std::floor(waves(i, frequency)); }

  /// Whether a and b are similar enough for interpolation between them.
  bool similar(std::size_t a, std::size_t b) const {
    constexpr double RATIO = 0.06, DEPTH = 0.3;
    const Knot &from = knots_[a], &to = knots_[b];
    if (guessFits(a, from.frequency) && guessFits(b, to.frequency))
      return close(from.depth / guess_.depth[a], to.depth / guess_.depth[b], RATIO);
    return close(from.depth, to.depth, DEPTH);
  }

  bool oneLobe(std::size_t a, std::size_t b) const {
    const Knot &from = knots_[a], &to = knots_[b];
    const double here = lobe(a, from.frequency);
    if (from.kind != to.kind || !close(from.frequency, to.frequency, SAME_LOBE) ||
        here != lobe(b, to.frequency))
      return false;
    if (!guessFits(a, from.frequency) || !guessFits(b, to.frequency)) return true;
    for (std::size_t i = a + 1; i < b; ++i)
      if (guessed(i) && (!guessFits(i, from.frequency) || lobe(i, guess_.chatter_frequency[i]) != here))
        return false;
    return true;
  }

  /// Whether a and b are stable to the largest depth, and the speeds between them by the first guess.
  bool noneBetween(std::size_t a, std::size_t b) const {
    if (std::isfinite(knots_[a].depth) || std::isfinite(knots_[b].depth)) return false;
    for (std::size_t i = a + 1; i < b; ++i)
      if (guessed(i) && guess_.depth[i] < max_depth_) return false;
    return true;
  }

  bool stableTo(std::size_t i, double depth) const {
    const auto here = solver_.at(speeds_[i]);
    for (const double share : {1.0, 0.75, 0.5})
      if (sampleOf(*here, share * depth).log_radius > 0.0) return false;
    return true;
  }

  void fill(std::size_t a, std::size_t b) {
    if (b - a < 2) return;
    const std::size_t middle = (a + b) / 2;
    if (noneBetween(a, b) && stableTo(middle, max_depth_)) return;
    const bool one = oneLobe(a, b);
    const Knot predicted = one ? between(a, b, middle) : acrossLobes(a, b, middle);
    if (!correct(middle, predicted)) search(middle);
    const Knot& found = knots_[middle];
    if (!one || !similar(a, b) || found.kind != knots_[a].kind ||
        !close(found.depth, predicted.depth, STRAIGHT) ||
        !close(found.frequency, predicted.frequency, STRAIGHT)) {
      fill(a, middle);
      fill(middle, b);
      return;
    }
    for (const auto& [from, to] : {std::pair{a, middle}, {middle, b}})
      for (std::size_t i = from + 1; i < to; ++i) knots_[i] = between(from, to, i);
  }

  const FloquetSolver& solver_;
  double max_depth_, start_ = 0.0;
  int teeth_;
  const std::vector<double>& speeds_;
  StabilityLimit guess_;
  std::vector<Knot> knots_;
};

}  // namespace

void WhatIf::validate() const {
  const auto optional = [](const char* key, double value, const Range& range, const char* unit) {
    if (!std::isnan(value)) require(key, value, range, unit);
  };
  require("teeth", teeth, Range::closed(0, 20));
  optional("helix", helix, Range::openHigh(0.0, units::radFromDeg(80.0)), "rad");
  optional("entry_angle", entry, Range::openHigh(0.0, units::TWO_PI), "rad");
  optional("exit_angle", exit, Range::openLow(0.0, units::TWO_PI), "rad");
  optional("feed_per_tooth", feed_per_tooth, Range::openLow(0.0, 0.01), "m");
  optional("overhang", overhang, Range::closed(0.25, 4.0), "1");
  optional("axial_depth", axial_depth, Range::openLow(0.0, 1.0), "m");
  require("speeds", speeds, Range::closed(0, 1000));
  require(speeds != 1, "speeds", speeds, "0 or at least 2");
}

// With q of unit modal mass the compliance of a mode is input x output / w^2.
std::vector<SystemMode> withOverhang(std::vector<SystemMode> modes, double overhang) {
  const double frequency = 1.0 / (overhang * overhang);
  const double gain = std::sqrt(overhang * overhang * overhang) * frequency;
  for (SystemMode& mode : modes) {
    mode.frequency *= frequency;
    for (std::size_t a = 0; a < 2; ++a) {
      mode.input[a] *= gain;
      mode.output[a] *= gain;
    }
  }
  return modes;
}

StabilityLimit limitsByContinuation(const RegenerativeSystem& system, const std::vector<double>& speeds,
                                    double max_depth) {
  constexpr int NODES = 8;
  SolverOptions options;
  options.tolerance = 1e-3;
  options.nodes = NODES;
  options.many = true;
  if (speeds.size() < 2) throw Error("what if: expected at least two speeds");
  return LimitContinuation(*makeFloquetSolver(Method::collocation, system, options), speeds, max_depth,
                           system.evenPitch() ? system.teeth : 0, firstGuess(system, speeds))
      .run();
}

int dominantMode(const std::vector<SystemMode>& modes, double frequency) {
  int found = -1;
  double largest = 0.0;
  if (std::isnan(frequency)) return found;
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const auto h = receptance({modes[k]}, frequency);
    const double size = std::sqrt(std::norm(h[0]) + std::norm(h[1]) + std::norm(h[2]) + std::norm(h[3]));
    if (!(size > largest)) continue;
    largest = size;
    found = static_cast<int>(k);
  }
  return found;
}

}  // namespace smartmill::stability
