#include <algorithm>
#include <cmath>

#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "solvers/arnoldi.h"
#include "solvers/floquet.h"

// Semi-discretization (Insperger and Stepan): within a step the feedback is replaced by its mean and the
// delayed motion by a polynomial through grid values; everything else is exact. The matrix over a period is
// never formed: applying it step by step to a history of the motion costs O(steps), and Arnoldi's method
// needs a few dozen applications.

namespace smartmill::stability {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct SemiDiscretizationOptions {
  int steps = 200;                     ///< in a principal period; second order: 0.1 % of the depth
  double eigenvalue_tolerance = 1e-9;  ///< [1] far below the error of the steps
};
constexpr SemiDiscretizationOptions DEFAULT;

/// phi_0 .. phi_count of X with phi_k = sum_j X^j / (j + k)!: Taylor series of the last, then phi_k = X
/// phi_{k+1} + 1 / k!.
std::vector<MatrixXd> phiFunctions(const MatrixXd& x, int count) {
  const Index n = x.rows();
  double factorial = 1.0;
  for (int k = 2; k <= count; ++k) factorial *= k;
  MatrixXd term = MatrixXd::Identity(n, n) / factorial, last = term;
  for (int j = 1; j < 400; ++j) {
    term = term * x / (j + count);
    last += term;
    if (term.cwiseAbs().maxCoeff() < 1e-17 * (1.0 + last.cwiseAbs().maxCoeff())) break;
  }
  std::vector<MatrixXd> phi(static_cast<std::size_t>(count) + 1);
  phi.back() = last;
  for (int k = count - 1; k >= 0; --k) {
    if (k > 0) factorial /= (k + 1);
    const double inverse = k > 0 ? 1.0 / factorial : 1.0;
    phi[static_cast<std::size_t>(k)] =
        x * phi[static_cast<std::size_t>(k) + 1] + inverse * MatrixXd::Identity(n, n);
  }
  return phi;
}

/// Mean of the feedback over a step, by Gauss quadrature between the breaks.
Feedback meanOf(const DelayedSystem& system, const std::vector<double>& breaks, double begin, double end) {
  Feedback mean;
  mean.delayed.assign(system.delays.size(), Eigen::Matrix2d::Zero());
  double from = begin;
  auto next = std::upper_bound(breaks.begin(), breaks.end(), begin + 1e-12 * system.period);
  Feedback f;
  while (from < end - 1e-13 * system.period) {
    double to = end;
    if (next != breaks.end() && *next < end) to = *next++;
    const double half = 0.5 * (to - from), middle = 0.5 * (to + from);
    for (const auto& [x, w] : GAUSS) {
      system.feedback(middle + x * half, middle, f);
      const double weight = w * half / (end - begin);
      mean.now += weight * f.now;
      mean.velocity += weight * f.velocity;
      for (std::size_t k = 0; k < f.delayed.size(); ++k) mean.delayed[k] += weight * f.delayed[k];
    }
    from = to;
  }
  return mean;
}

class StepMap {
 public:
  StepMap(const DelayedSystem& system, int steps, int order)
      : system_(system),
        axes_(system.modes),
        d_(axes_.count()),
        m2_(2 * static_cast<Index>(system.modes.size())) {
    const double h = system.period / steps;
    const double longest = *std::max_element(system.delays.begin(), system.delays.end());
    if (*std::min_element(system.delays.begin(), system.delays.end()) < 2.0 * h)
      throw Error("semi_discretization: " + std::to_string(steps) +
                  " steps, longer than half the shortest delay: expected more steps");
    // One value beyond the longest delay, for the interpolation on both sides.
    ring_ = static_cast<Index>(std::ceil(longest / h - 1e-9)) + 2;
    MatrixXd a = MatrixXd::Zero(m2_, m2_), in = MatrixXd::Zero(m2_, d_);
    out_ = MatrixXd::Zero(d_, m2_);
    MatrixXd rate = MatrixXd::Zero(d_, m2_);
    for (std::size_t k = 0; k < system.modes.size(); ++k) {
      const SystemMode& mode = system.modes[k];
      const Index c = 2 * static_cast<Index>(k);
      const double w = units::TWO_PI * mode.frequency;
      a(c, c + 1) = w;
      a(c + 1, c) = -w;
      a(c + 1, c + 1) = -2.0 * mode.damping_ratio * w;
      for (Index p = 0; p < d_; ++p) {
        in(c + 1, p) = mode.input[axes_.index[static_cast<std::size_t>(p)]] / w;
        out_(p, c) = mode.output[axes_.index[static_cast<std::size_t>(p)]];
        rate(p, c + 1) = w * mode.output[axes_.index[static_cast<std::size_t>(p)]];
      }
    }
    for (std::size_t k = 0; k < system.delays.size(); ++k)
      taps_.push_back(tapsOf(system.delays[k] / h, order));
    std::vector<double> breaks = system.breaks;
    std::sort(breaks.begin(), breaks.end());
    MatrixXd free;
    for (int i = 0; i < steps; ++i) {
      const Feedback mean = meanOf(system, breaks, i * h, (i + 1) * h);
      Step step;
      const bool cuts =
          !mean.now.isZero(0.0) || !mean.velocity.isZero(0.0) ||
          std::any_of(mean.delayed.begin(), mean.delayed.end(), [](const auto& m) { return !m.isZero(0.0); });
      if (!cuts) {
        if (free.size() == 0) free = phiFunctions(a * h, 1)[0];
        step.flow = free;
      } else {
        const MatrixXd x =
            h * (a + in * (axes_.reduced(mean.now) * out_ + axes_.reduced(mean.velocity) * rate));
        const std::vector<MatrixXd> phi = phiFunctions(x, order + 1);
        step.flow = phi[0];
        double factorial = 1.0;
        for (int p = 0; p <= order; ++p) {
          if (p > 1) factorial *= p;
          step.force.push_back(h * factorial * phi[static_cast<std::size_t>(p) + 1] * in);
        }
        for (const auto& m : mean.delayed)
          step.delayed.push_back(m.isZero(0.0) ? MatrixXd() : axes_.reduced(m));
      }
      steps_.push_back(std::move(step));
    }
  }

  Dominant dominant(bool with_vector) {
    Index expected = 0;
    return dominantEigenvalue([this](const VectorXd& in, VectorXd& out) { march(in, out, nullptr); },
                              m2_ + d_ * ring_, DEFAULT.eigenvalue_tolerance, with_vector, expected);
  }

  double strongest(const Dominant& mode, double highest) {
    VectorXd out;
    MatrixXd re, im;
    march(mode.vector.real(), out, &re);
    march(mode.vector.imag(), out, &im);
    const double base = std::arg(mode.value) / system_.period, step = units::TWO_PI / system_.period;
    const double h = system_.period / static_cast<double>(steps_.size());
    const int most = std::min(static_cast<int>(steps_.size() / 2), static_cast<int>(highest / step) + 2);
    double best = -1.0, frequency = 0.0;
    for (int k = -most; k <= most; ++k) {
      Eigen::VectorXcd sum = Eigen::VectorXcd::Zero(d_);
      for (Index i = 0; i < re.cols(); ++i)
        sum += std::polar(1.0, -(base + k * step) * h * static_cast<double>(i)) *
               (re.col(i).cast<std::complex<double>>() +
                std::complex<double>(0, 1) * im.col(i).cast<std::complex<double>>());
      if (sum.norm() > best) {
        best = sum.norm();
        frequency = std::abs(base + k * step) / units::TWO_PI;
      }
    }
    return frequency;
  }

 private:
  /// Weight of the grid value at step i - back in the delayed motion at t_i + s: polynomial in s / h.
  struct Tap {
    Index back;
    std::vector<double> coefficients;
  };
  struct Step {
    MatrixXd flow;                  // 2M x 2M
    std::vector<MatrixXd> force;    // per power: 2M x D
    std::vector<MatrixXd> delayed;  // per delay: D x D, empty where zero
  };

  /// @param delay in steps
  static std::vector<Tap> tapsOf(double delay, int order) {
    const auto below =
        static_cast<Index>(std::ceil(delay - 1e-9));  // i - below: last grid time before the delayed time
    const double offset =
        static_cast<double>(below) - delay;  // [steps] delayed time after it, 0 <= value < 1
    if (order == 0) {
      // Value in the middle of the step.
      const double x = offset + 0.5;
      if (x <= 1.0) return {{below, {1.0 - x}}, {below - 1, {x}}};
      return {{below - 1, {2.0 - x}}, {below - 2, {x - 1.0}}};
    }
    // Lagrange interpolation in x = offset + s / h, steps after i - below.
    if (order == 1) return {{below, {1.0 - offset, -1.0}}, {below - 1, {offset, 1.0}}};
    const double o = offset;
    return {{below + 1, {0.5 * o * (o - 1.0), 0.5 * (2.0 * o - 1.0), 0.5}},
            {below, {(1.0 - o) * (1.0 + o), -2.0 * o, -1.0}},
            {below - 1, {0.5 * o * (o + 1.0), 0.5 * (2.0 * o + 1.0), 0.5}}};
  }

  // Vector: state, then the motion 1, 2, ... ring_ steps before.
  void march(const VectorXd& in, VectorXd& out, MatrixXd* motion) {
    const auto count = static_cast<Index>(steps_.size());
    MatrixXd past(d_, ring_ + count);  // column ring_ + i: motion at step i
    for (Index b = 1; b <= ring_; ++b) past.col(ring_ - b) = in.segment(m2_ + (b - 1) * d_, d_);
    VectorXd state = in.head(m2_), next(m2_), force(d_), value(d_);
    for (Index i = 0; i < count; ++i) {
      past.col(ring_ + i).noalias() = out_ * state;
      const Step& step = steps_[static_cast<std::size_t>(i)];
      next.noalias() = step.flow * state;
      for (std::size_t p = 0; p < step.force.size(); ++p) {
        force.setZero();
        for (std::size_t k = 0; k < step.delayed.size(); ++k) {
          if (step.delayed[k].size() == 0) continue;
          value.setZero();
          for (const Tap& tap : taps_[k]) value += tap.coefficients[p] * past.col(ring_ + i - tap.back);
          force.noalias() += step.delayed[k] * value;
        }
        next.noalias() += step.force[p] * force;
      }
      state.swap(next);
    }
    out.resize(m2_ + d_ * ring_);
    out.head(m2_) = state;
    for (Index b = 1; b <= ring_; ++b) out.segment(m2_ + (b - 1) * d_, d_) = past.col(ring_ + count - b);
    if (motion) *motion = past.rightCols(count);
  }

  const DelayedSystem& system_;
  Axes axes_;
  Index d_, m2_, ring_ = 0;
  MatrixXd out_;
  std::vector<std::vector<Tap>> taps_;
  std::vector<Step> steps_;
};

class SemiDiscretization : public FloquetSolver {
 public:
  SemiDiscretization(const RegenerativeSystem& system, const SolverOptions& options)
      : FloquetSolver(system, options) {
    if (options_.steps == 0) options_.steps = DEFAULT.steps;
  }

  class Speed : public AtSpeed {
   public:
    Speed(const RegenerativeSystem& system, const SolverOptions& options, double speed)
        : system_(system), options_(options), speed_(speed) {}

    CharacteristicMultiplier multiplier(double depth) override {
      return semiDiscretizationMultiplier(delayedSystem(system_, speed_, depth), options_.steps,
                                          options_.order);
    }

    double chatterFrequency(double depth) override {
      const DelayedSystem delayed = delayedSystem(system_, speed_, depth);
      StepMap map(delayed, options_.steps, options_.order);
      return map.strongest(map.dominant(true), highestOf(system_));
    }

   private:
    RegenerativeSystem system_;
    SolverOptions options_;
    double speed_;
  };

  std::unique_ptr<AtSpeed> at(double speed) const override {
    return std::make_unique<Speed>(system_, options_, speed);
  }

  std::unique_ptr<FloquetSolver> refined() const override {
    SolverOptions finer = options_;
    finer.steps *= 2;
    finer.estimate_error = false;
    return std::make_unique<SemiDiscretization>(system_, finer);
  }
};

}  // namespace

std::unique_ptr<FloquetSolver> makeSemiDiscretization(const RegenerativeSystem& system,
                                                      const SolverOptions& options) {
  if (options.steps != 0 && (options.steps < 4 || options.steps > 1000000))
    throw Error("steps: " + std::to_string(options.steps) + ": expected 4..1000000");
  if (options.order < 0 || options.order > 2)
    throw Error("order: " + std::to_string(options.order) + ": expected 0..2");
  return std::make_unique<SemiDiscretization>(system, options);
}

CharacteristicMultiplier semiDiscretizationMultiplier(const DelayedSystem& system, int steps, int order) {
  StepMap map(system, steps, order);
  return {map.dominant(false).value, system.period};
}

}  // namespace smartmill::stability
