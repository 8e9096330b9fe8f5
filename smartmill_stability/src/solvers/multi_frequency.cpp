#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_core/units.h"
#include "solvers/harmonic_balance.h"

// Multi-frequency solution (Budak and Altintas): chatter at w contains tool motion at w + k w_T, coupled by
// the harmonics of the feedback: U_r = depth G(w + r w_T) sum_l F_{r - l}(w + l w_T) U_l. The depth is the
// inverse of an eigenvalue where that is real and positive. The zero-order solution retains only the mean of
// the feedback.

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using units::TWO_PI;

struct MultiFrequencyOptions {
  int harmonics = 10;  ///< of the tooth passing frequency on each side; third order: 0.1 % of the depth
  int lines = 60;      ///< evenly spaced chatter frequencies
  int dense = 12;      ///< more on each side of the alias of a natural frequency, where eigenvalues turn fast
  // With helix
  double growth = 1.12;  ///< [1] of the depth from one sweep to the next
  double below = 0.5;    ///< [1] first depth over the limit without helix
  double close = 0.02;   ///< [1] least growth; half of it: error of the depth of a crossing
};
constexpr MultiFrequencyOptions DEFAULT;

struct Crossing {
  double w = 0.0;
  Complex value;
};

Complex nearest(const std::vector<Complex>& values, Complex to) {
  Complex best = std::numeric_limits<double>::infinity();
  for (const Complex& v : values)
    if (std::abs(v - to) < std::abs(best - to)) best = v;
  return best;
}

class MultiFrequency : public StabilitySolver {
 public:
  MultiFrequency(const RegenerativeSystem& system, const SolverOptions& options)
      : system_(system), options_(options), axes_(system.response ? bothAxes() : Axes(system.modes)) {
    if (options_.harmonics == 0) options_.harmonics = DEFAULT.harmonics;
    if (system_.chip)
      throw Error(
          "multi_frequency: chip geometry (the contact changes with the depth): expected method collocation");
    for (const SystemMode& mode : system_.modes) {
      peaks_.push_back(TWO_PI * mode.frequency);
      widths_.push_back(TWO_PI * mode.frequency * mode.damping_ratio);
    }
    highest_ = peaks_.empty() ? TWO_PI * system_.response->frequency.back() / 1.5
                              : *std::max_element(peaks_.begin(), peaks_.end());
  }

  Limit limit(double speed, double max_depth) const override {
    if (!(max_depth > 0.0)) throw Error("stability: largest depth: expected a value above 0");
    Limit limit = solve(speed, max_depth, options_.harmonics);
    if (options_.estimate_error && std::isfinite(limit.depth))
      limit.error = std::abs(solve(speed, max_depth, 2 * options_.harmonics).depth - limit.depth);
    return limit;
  }

 private:
  static Axes bothAxes() { return Axes({SystemMode{1.0, 0.5, {{1.0, 1.0}}, {{1.0, 1.0}}}}); }

  Limit solve(double speed, double max_depth, int extra) const {
    const double period = TWO_PI / speed / (system_.evenPitch() ? system_.teeth : 1);
    const int within = static_cast<int>(std::ceil(highest_ * period / TWO_PI));
    const int reach = within + extra;
    if (system_.dependsOnHeight()) return withHelix(speed, max_depth, reach);
    // The harmonics -reach .. reach - 1 are symmetric at half a step, the frequency of a flip.
    const Balance balance(system_, axes_, speed, reach, reach - 1);
    Limit limit;
    Crossing first;
    for (const Crossing& c : crossings(balance, max_depth)) {
      const double depth = 1.0 / c.value.real();
      if (depth >= limit.depth) continue;
      limit.depth = depth;
      first = c;
    }
    describe(balance, first, limit);
    return limit;
  }

  void describe(const Balance& balance, const Crossing& at, Limit& limit) const {
    if (!std::isfinite(limit.depth)) return;
    limit.kind = std::abs(at.w - 0.5 * balance.step()) < 1e-6 * balance.step() ? Kind::flip : Kind::hopf;
    limit.frequency = balance.strongest(at.w, at.value);
  }

  /// Crossings for the feedback with the helix lag of one depth.
  struct Sweep {
    double depth = 0.0;
    int below = 0;         // number of crossings below the depth
    double nearest = 0.0;  // log(nearest crossing / depth)
    Crossing at;
  };
  Sweep sweep(double speed, int reach, double depth) const {
    const Balance balance(system_, axes_, speed, reach, reach - 1, depth);
    Sweep sweep;
    sweep.depth = depth;
    sweep.nearest = std::numeric_limits<double>::infinity();
    for (const Crossing& c : crossings(balance, 4.0 * depth)) {
      const double ratio = -std::log(c.value.real() * depth);
      sweep.below += ratio < 0.0;
      if (std::abs(ratio) < std::abs(sweep.nearest)) {
        sweep.nearest = ratio;
        sweep.at = c;
      }
    }
    return sweep;
  }

  /// [m] Limit without helix, close to that with helix unless the lag of the edge is large.
  double straightLimit(double speed, double max_depth, int reach) const {
    RegenerativeSystem straight = system_.straightened(max_depth);
    straight.helix = 0.0;
    const Balance plain(straight, axes_, speed, reach, reach - 1);
    double limit = max_depth;
    for (const Crossing& c : crossings(plain, 4.0 * max_depth)) limit = std::min(limit, 1.0 / c.value.real());
    return limit;
  }

  /// Depth at which the number of crossings below it changes, between two depths with different numbers.
  Sweep change(double speed, int reach, Sweep a, Sweep b) const {
    const int below = a.below;
    for (int i = 0; i < 40 && b.depth / a.depth - 1.0 > options_.tolerance; ++i) {
      // False position where the same crossing lies above one depth and below the other, otherwise bisection.
      double share = 0.5;
      if (i % 3 != 2 && a.nearest > 0.0 && b.nearest < 0.0 && std::isfinite(a.nearest - b.nearest))
        share = std::clamp(a.nearest / (a.nearest - b.nearest), 1e-3, 1.0 - 1e-3);
      const Sweep middle = sweep(speed, reach, a.depth + share * (b.depth - a.depth));
      if (std::abs(middle.nearest) < 0.1 * options_.tolerance) return middle;
      (middle.below != below ? b : a) = middle;
    }
    return std::abs(a.nearest) < std::abs(b.nearest) ? a : b;
  }

  /// With helix the lag of the edge depends on the depth d. The feedback with the lag of d has crossings
  /// a_i(d), and the stability boundary is where a_i(d) = d. For small d all a_i lie above d; the first
  /// solution with growing d is the first loss of stability.
  Limit withHelix(double speed, double max_depth, int reach) const {
    Limit limit;
    Sweep before =
        sweep(speed, reach, std::min(DEFAULT.below * straightLimit(speed, max_depth, reach), max_depth));
    // Start lower if the first depth is unstable.
    for (int i = 0; i < 20 && before.below > 0; ++i) before = sweep(speed, reach, 0.5 * before.depth);
    while (before.depth < max_depth) {
      // At most slightly beyond the predicted crossing.
      const double growth =
          before.nearest > 0.0 && std::isfinite(before.nearest)
              ? std::clamp(std::exp(1.1 * before.nearest), 1.0 + DEFAULT.close, DEFAULT.growth)
              : DEFAULT.growth;
      const Sweep next = sweep(speed, reach, std::min(max_depth, growth * before.depth));
      if (next.below != before.below) {
        const Sweep found = change(speed, reach, before, next);
        // A pair of crossings that appears below the depth is no boundary at this depth.
        if (std::abs(found.nearest) < 0.5 * DEFAULT.close) {
          limit.depth = found.depth;
          describe(Balance(system_, axes_, speed, reach, reach - 1, found.depth), found.at, limit);
          return limit;
        }
      }
      before = next;
    }
    return limit;
  }

  /// All depths up to the largest at which an eigenvalue is real and positive.
  std::vector<Crossing> crossings(const Balance& balance, double max_depth) const {
    const double step = balance.step(), least = 0.5 / max_depth;
    const std::vector<double> grid = gridOf(step);
    std::vector<Crossing> found;
    const auto consider = [&](const Crossing& c) {
      const double depth = 1.0 / c.value.real();
      if (depth > 0.0 && depth <= max_depth) found.push_back(c);
    };
    std::vector<Complex> before;
    for (std::size_t i = 0; i < grid.size(); ++i) {
      const std::vector<Complex> values = balance.eigenvalues(grid[i], least);
      if (i + 1 == grid.size()) {
        for (const Complex& v : values)
          if (std::abs(v.imag()) < 1e-7 * std::abs(v)) consider({grid[i], v});
      }
      for (const Complex& a : before) {
        const Complex b = nearest(values, a);
        if (!std::isfinite(b.real()) || a.imag() * b.imag() >= 0.0) continue;
        if (a.real() <= 0.0 && b.real() <= 0.0) continue;
        consider(crossing(balance, grid[i - 1], a, grid[i], b, least));
      }
      before = values;
    }
    return found;
  }

  Crossing crossing(const Balance& balance, double wa, Complex a, double wb, Complex b, double least) const {
    for (int i = 0; i < 40 && wb - wa > 1e-12 * balance.step(); ++i) {
      // Secant, kept off the ends; bisection every third time.
      double share = i % 3 == 2 ? 0.5 : a.imag() / (a.imag() - b.imag());
      share = std::clamp(share, 1e-3, 1.0 - 1e-3);
      const double w = wa + share * (wb - wa);
      const Complex c = nearest(balance.eigenvalues(w, least), a + share * (b - a));
      if (!std::isfinite(c.real())) break;
      const bool done = std::abs(c.imag()) < 1e-2 * options_.tolerance * std::abs(c);
      if (a.imag() * c.imag() > 0.0) {
        wa = w;
        a = c;
      } else {
        wb = w;
        b = c;
      }
      if (done) return {w, c};
    }
    const double share = a.imag() / (a.imag() - b.imag());
    return {wa + share * (wb - wa), a + share * (b - a)};
  }

  /// [rad/s] Frequencies from 0 to half a step, dense around the aliases of the natural frequencies.
  std::vector<double> gridOf(double step) const {
    const double half = 0.5 * step;
    const int uniform = options_.lines > 0 ? options_.lines : DEFAULT.lines;
    std::vector<double> grid;
    for (int i = 0; i <= uniform; ++i) grid.push_back(half * i / uniform);
    for (std::size_t m = 0; m < peaks_.size(); ++m) {
      for (int i = -DEFAULT.dense; i <= DEFAULT.dense; ++i) {
        const double w = peaks_[m] + 8.0 * widths_[m] * std::pow(static_cast<double>(i) / DEFAULT.dense, 3) +
                         widths_[m] * i / DEFAULT.dense;
        const double folded = std::abs(std::remainder(w, step));
        grid.push_back(folded);
      }
    }
    std::sort(grid.begin(), grid.end());
    grid.erase(std::unique(grid.begin(), grid.end()), grid.end());
    return grid;
  }

  RegenerativeSystem system_;
  SolverOptions options_;
  Axes axes_;
  std::vector<double> peaks_, widths_;
  double highest_ = 0.0;
};

}  // namespace

std::unique_ptr<StabilitySolver> makeMultiFrequency(const RegenerativeSystem& system,
                                                    const SolverOptions& options) {
  needDynamics(system);
  if (options.harmonics < 0 || options.harmonics > 400)
    throw Error("harmonics: " + std::to_string(options.harmonics) + ": expected 0..400");
  return std::make_unique<MultiFrequency>(system, options);
}

}  // namespace smartmill::stability
