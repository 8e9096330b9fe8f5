#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "solvers/floquet.h"

// Multi-frequency solution (Budak and Altintas): chatter at w contains tool motion at w + k w_T, coupled by
// the harmonics of the feedback: U_r = depth G(w + r w_T) sum_l F_{r - l}(w + l w_T) U_l. The depth is the
// inverse of an eigenvalue where that is real and positive. The zero-order solution retains only the mean of
// the feedback.

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using units::TWO_PI;

constexpr int DEFAULT_HARMONICS = 10;

/// Receptance of the system at w [rad/s], from its lines or its modes.
Eigen::Matrix2cd receptanceOf(const RegenerativeSystem& system, double w) {
  const auto g = system.response ? system.response->at(w / TWO_PI) : receptance(system.modes, w / TWO_PI);
  Eigen::Matrix2cd m;
  m << g[0], g[1], g[2], g[3];
  return m;
}

/// Fourier coefficients of the feedback for a depth of one metre.
struct Harmonics {
  double step = 0.0;  ///< [rad/s] between harmonics
  std::vector<double> delays;
  std::vector<Eigen::Matrix2cd> now, velocity;         ///< [k + most]
  std::vector<std::vector<Eigen::Matrix2cd>> delayed;  ///< [k + most][delay]
  int most = 0;

  Eigen::Matrix2cd at(int k, double w) const {
    const auto i = static_cast<std::size_t>(k + most);
    Eigen::Matrix2cd f = now[i] + Complex(0.0, w) * velocity[i];
    for (std::size_t d = 0; d < delays.size(); ++d) f += std::polar(1.0, -w * delays[d]) * delayed[i][d];
    return f;
  }
};

/// @param depth [m] at which the feedback is evaluated, and by which it is divided
Harmonics harmonicsOf(const RegenerativeSystem& system, double speed, int most, double depth = 1.0) {
  const DelayedSystem unit = delayedSystem(system, speed, depth);
  Harmonics h;
  h.step = TWO_PI / unit.period;
  h.delays = unit.delays;
  h.most = most;
  const auto count = static_cast<std::size_t>(2 * most + 1);
  h.now.assign(count, Eigen::Matrix2cd::Zero());
  h.velocity = h.now;
  h.delayed.assign(count, std::vector<Eigen::Matrix2cd>(unit.delays.size(), Eigen::Matrix2cd::Zero()));
  std::vector<double> ends = unit.breaks;
  ends.push_back(0.0);
  ends.push_back(unit.period);
  std::sort(ends.begin(), ends.end());
  // Three-point Gauss quadrature on parts much shorter than the period of the highest harmonic.
  const double longest = unit.period / (12.0 * (most + 2));
  Feedback f;
  for (std::size_t e = 0; e + 1 < ends.size(); ++e) {
    const double length = ends[e + 1] - ends[e];
    if (length < 1e-10 * unit.period) continue;
    const int parts = static_cast<int>(std::ceil(length / longest));
    for (int p = 0; p < parts; ++p) {
      const double half = 0.5 * length / parts, middle = ends[e] + (2 * p + 1) * half;
      constexpr double NODE = 0.7745966692414834;
      for (const auto& [x, w] : {std::pair{-NODE, 5.0 / 9.0}, {0.0, 8.0 / 9.0}, {NODE, 5.0 / 9.0}}) {
        const double t = middle + x * half, weight = w * half / unit.period / depth;
        unit.feedback(t, middle, f);
        for (int k = -most; k <= most; ++k) {
          const auto i = static_cast<std::size_t>(k + most);
          const Complex kernel = weight * std::polar(1.0, -k * h.step * t);
          h.now[i] += kernel * f.now;
          h.velocity[i] += kernel * f.velocity;
          for (std::size_t d = 0; d < f.delayed.size(); ++d) h.delayed[i][d] += kernel * f.delayed[d];
        }
      }
    }
  }
  return h;
}

/// Harmonic balance at one speed.
class Balance {
 public:
  /// @param depth [m] at which the feedback is evaluated (with helix it is not proportional to the depth)
  Balance(const RegenerativeSystem& system, const Axes& axes, double speed, int below, int above,
          double depth = 1.0)
      : system_(system),
        axes_(axes),
        below_(below),
        above_(above),
        harmonics_(harmonicsOf(system, speed, below + above, depth)) {}

  double step() const { return harmonics_.step; }

  MatrixXcd matrix(double w) const {
    const Index d = axes_.count(), n = (below_ + above_ + 1);
    MatrixXcd m(n * d, n * d);
    std::vector<Eigen::Matrix2cd> g;
    for (int r = -below_; r <= above_; ++r) g.push_back(receptanceOf(system_, w + r * harmonics_.step));
    for (Index r = 0; r < n; ++r) {
      for (Index l = 0; l < n; ++l) {
        const Eigen::Matrix2cd f =
            g[static_cast<std::size_t>(r)] *
            harmonics_.at(static_cast<int>(r - l), w + (static_cast<double>(l) - below_) * harmonics_.step);
        for (Index p = 0; p < d; ++p)
          for (Index q = 0; q < d; ++q)
            m(r * d + p, l * d + q) = f(static_cast<Index>(axes_.index[static_cast<std::size_t>(p)]),
                                        static_cast<Index>(axes_.index[static_cast<std::size_t>(q)]));
      }
    }
    return m;
  }

  /// [1/m] Eigenvalues at w [rad/s] with a modulus above `least`.
  std::vector<Complex> eigenvalues(double w, double least) const {
    std::vector<Complex> large;
    for (const Complex& value : linear::eigenvalues(matrix(w)))
      if (std::abs(value) > least) large.push_back(value);
    return large;
  }

  /// [Hz] Frequency of the largest component of the eigenvector of an eigenvalue.
  double strongest(double w, Complex value) const {
    MatrixXcd m = matrix(w);
    m.diagonal().array() -= value * (1.0 + 1e-10);
    const Eigen::PartialPivLU<MatrixXcd> lu(m);
    Eigen::VectorXcd u = Eigen::VectorXcd::Ones(m.rows());
    for (int i = 0; i < 3; ++i) u = lu.solve(u).normalized();
    const Index d = axes_.count();
    double best = -1.0, frequency = 0.0;
    for (Index r = 0; r * d < u.size(); ++r) {
      const double size = u.segment(r * d, d).norm();
      if (size > best) {
        best = size;
        frequency = std::abs(w + (static_cast<double>(r) - below_) * harmonics_.step) / TWO_PI;
      }
    }
    return frequency;
  }

 private:
  const RegenerativeSystem& system_;
  const Axes& axes_;
  int below_, above_;
  Harmonics harmonics_;
};

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
    if (options_.harmonics == 0) options_.harmonics = DEFAULT_HARMONICS;
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
    if (system_.helix > 0.0) return withHelix(speed, max_depth, reach);
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
    RegenerativeSystem straight = system_;
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
    constexpr double GROWTH = 1.12, BELOW = 0.5, CLOSE = 0.02;
    Limit limit;
    Sweep before = sweep(speed, reach, std::min(BELOW * straightLimit(speed, max_depth, reach), max_depth));
    // Start lower if the first depth is unstable.
    for (int i = 0; i < 20 && before.below > 0; ++i) before = sweep(speed, reach, 0.5 * before.depth);
    while (before.depth < max_depth) {
      // At most slightly beyond the predicted crossing.
      const double growth = before.nearest > 0.0 && std::isfinite(before.nearest)
                                ? std::clamp(std::exp(1.1 * before.nearest), 1.0 + CLOSE, GROWTH)
                                : GROWTH;
      const Sweep next = sweep(speed, reach, std::min(max_depth, growth * before.depth));
      if (next.below != before.below) {
        const Sweep found = change(speed, reach, before, next);
        // A pair of crossings that appears below the depth is no boundary at this depth.
        if (std::abs(found.nearest) < 0.5 * CLOSE) {
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
    const int uniform = options_.lines > 0 ? options_.lines : 60;
    std::vector<double> grid;
    for (int i = 0; i <= uniform; ++i) grid.push_back(half * i / uniform);
    for (std::size_t m = 0; m < peaks_.size(); ++m) {
      constexpr int DENSE = 12;
      for (int i = -DENSE; i <= DENSE; ++i) {
        const double w = peaks_[m] + 8.0 * widths_[m] * std::pow(static_cast<double>(i) / DENSE, 3) +
                         widths_[m] * i / DENSE;
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

/// Mean feedback only. Milling with even pitch: zeroOrderLimit() for all speeds; otherwise (several delays,
/// overlap, damping) sign changes of the imaginary part over the lines at each speed.
class ZeroOrder : public StabilitySolver {
 public:
  explicit ZeroOrder(const RegenerativeSystem& system) : system_(system) {
    if (system_.response) {
      response_ = *system_.response;
    } else {
      double highest = 0.0;
      for (const SystemMode& mode : system_.modes) highest = std::max(highest, mode.frequency);
      response_ = responseOf(system_.modes, 1.0, 3.0 * highest, 40000);
    }
  }

  Limit limit(double speed, double max_depth) const override { return limits({speed}, max_depth).front(); }

  std::vector<Limit> limits(const std::vector<double>& speeds, double max_depth) const override {
    if (!(max_depth > 0.0)) throw Error("stability: largest depth: expected a value above 0");
    const bool damped = system_.damping_radial > 0.0 || system_.damping_tangential > 0.0;
    if (system_.cut == Cut::milling && system_.evenPitch() && system_.overlap == 1.0 && !damped &&
        !system_.chip && system_.kt > 0.0) {
      const RegenerativeProcess process{system_.teeth, system_.entry, system_.exit, system_.kt,
                                        system_.kr / system_.kt};
      std::vector<double> sorted = speeds;
      std::sort(sorted.begin(), sorted.end());
      sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
      const StabilityLimit found = zeroOrderLimit(process, response_, sorted);
      std::vector<Limit> limits(speeds.size());
      for (std::size_t i = 0; i < speeds.size(); ++i) {
        const auto k = static_cast<std::size_t>(std::lower_bound(sorted.begin(), sorted.end(), speeds[i]) -
                                                sorted.begin());
        if (found.depth[k] > max_depth) continue;
        limits[i].depth = found.depth[k];
        limits[i].frequency = found.chatter_frequency[k];
        limits[i].kind = Kind::hopf;
      }
      return limits;
    }
    std::vector<Limit> limits;
    for (const double speed : speeds) limits.push_back(general(speed, max_depth));
    return limits;
  }

 private:
  Limit general(double speed, double max_depth) const {
    RegenerativeSystem straight = system_;
    straight.helix = 0.0;  // no effect on the mean
    // Serration: mean over a whole wave.
    double height = 1.0;  // [m]
    if (straight.chip) {
      straight.chip->forced_vibration = false;
      if (straight.chip->serration_amplitude > 0.0) height = straight.chip->serration_wavelength;
    }
    const Harmonics mean = harmonicsOf(straight, speed, 0, height);
    Limit limit;
    std::array<Complex, 2> before{};
    for (std::size_t i = 0; i < response_.frequency.size(); ++i) {
      const double w = TWO_PI * response_.frequency[i];
      const auto g = response_.at(response_.frequency[i]);
      Eigen::Matrix2cd m;
      m << g[0], g[1], g[2], g[3];
      m = (m * mean.at(0, w)).eval();
      const Complex root = std::sqrt(m.trace() * m.trace() - 4.0 * m.determinant());
      std::array<Complex, 2> now{{0.5 * (m.trace() + root), 0.5 * (m.trace() - root)}};
      if (i > 0) {
        if (std::abs(now[0] - before[0]) + std::abs(now[1] - before[1]) >
            std::abs(now[1] - before[0]) + std::abs(now[0] - before[1]))
          std::swap(now[0], now[1]);
        for (std::size_t b = 0; b < 2; ++b) {
          if (before[b].imag() * now[b].imag() >= 0.0) continue;
          const double share = before[b].imag() / (before[b].imag() - now[b].imag());
          const double depth = 1.0 / (before[b] + share * (now[b] - before[b])).real();
          if (!(depth > 0.0) || depth >= std::min(limit.depth, max_depth)) continue;
          limit.depth = depth;
          limit.frequency =
              response_.frequency[i - 1] + share * (response_.frequency[i] - response_.frequency[i - 1]);
          limit.kind = Kind::hopf;
        }
      }
      before = now;
    }
    return limit;
  }

  RegenerativeSystem system_;
  ToolTipResponse response_;
};

void needDynamics(const RegenerativeSystem& system) {
  system.validate();
  if (system.modes.empty() && !system.response)
    throw Error("stability: expected modes or receptances of the tool tip");
  if (system.response && system.response->frequency.size() < 2)
    throw Error("stability: FRF of the tool tip: expected at least 2 lines");
}

}  // namespace

ToolTipResponse responseOf(const std::vector<SystemMode>& modes, double low, double high, std::size_t lines) {
  ModalModel grid;
  for (const SystemMode& mode : modes) grid.modes.push_back({mode.frequency, mode.damping_ratio, 0.0});
  ToolTipResponse response;
  response.frequency = responseOf(grid, ModalModel{}, low, high, lines).frequency;
  for (const double f : response.frequency) {
    const auto g = receptance(modes, f);
    response.xx.push_back(g[0]);
    response.xy.push_back(g[1]);
    response.yx.push_back(g[2]);
    response.yy.push_back(g[3]);
  }
  return response;
}

std::unique_ptr<StabilitySolver> makeMultiFrequency(const RegenerativeSystem& system,
                                                    const SolverOptions& options) {
  needDynamics(system);
  if (options.harmonics < 0 || options.harmonics > 400)
    throw Error("harmonics: " + std::to_string(options.harmonics) + ": expected 0..400");
  return std::make_unique<MultiFrequency>(system, options);
}

std::unique_ptr<StabilitySolver> makeZeroOrder(const RegenerativeSystem& system) {
  needDynamics(system);
  return std::make_unique<ZeroOrder>(system);
}

}  // namespace smartmill::stability
