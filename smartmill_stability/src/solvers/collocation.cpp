#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/LU>
#include <boost/math/special_functions/legendre.hpp>

#include "smartmill_core/error.h"
#include "smartmill_stability/solvers/delayed_system.h"
#include "solvers/arnoldi.h"
#include "solvers/floquet.h"

// Chebyshev collocation of the feedback force. On each element the force is the polynomial through its values
// at the Chebyshev-Lobatto nodes. The response of the modes to it is exact (convolution with exp(s t) in
// closed form), so only the force has to be resolved, and the free motion between cuts has no error. Elements
// end at the breaks.

namespace smartmill::stability {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// [rad] Largest phase of vibration and feedback over an element; with the default of 12 nodes the error of
/// the depth is 1e-7.
constexpr double PHASE = 9.0;
constexpr int DEFAULT_NODES = 12, REFINEMENT = 4;
constexpr double EIGENVALUE_TOLERANCE = 1e-9, COARSEST_EIGENVALUE = 1e-6;

/// [1] Tolerance of an eigenvalue for the tolerance of the depth in the options.
double eigenvalueTolerance(const SolverOptions& options) {
  constexpr double SHARE = 1e-3, SHARE_OF_MANY = 0.1;
  if (options.many) return SHARE_OF_MANY * options.tolerance;
  return std::clamp(SHARE * options.tolerance, EIGENVALUE_TOLERANCE, COARSEST_EIGENVALUE);
}

/// Nodes, quadrature and interpolation on the unit interval.
struct Reference {
  explicit Reference(int count) : n(count), node(static_cast<std::size_t>(count)) {
    for (int i = 0; i < n; ++i)
      node[static_cast<std::size_t>(i)] = 0.5 * (1.0 - std::cos(units::PI * i / (n - 1)));
    const auto points = static_cast<std::size_t>(n + 6);
    gaussRule(static_cast<int>(points));
    quadrature = VectorXd::Zero(n);
    for (int i = 0; i < n; ++i) {
      MatrixXd values(n, static_cast<Index>(points));
      for (std::size_t q = 0; q < points; ++q)
        values.col(static_cast<Index>(q)) = weights(node[static_cast<std::size_t>(i)] * gauss[q]);
      lagrange.push_back(values);
    }
    for (std::size_t q = 0; q < points; ++q)
      quadrature += weight[q] * lagrange.back().col(static_cast<Index>(q));
  }

  /// Lagrange polynomials at x in [0, 1], barycentric.
  VectorXd weights(double x) const {
    VectorXd w = VectorXd::Zero(n);
    double sum = 0.0;
    for (int i = 0; i < n; ++i) {
      const double distance = x - node[static_cast<std::size_t>(i)];
      if (std::abs(distance) < 1e-14) {
        w.setZero();
        w[i] = 1.0;
        return w;
      }
      const double b = (i % 2 ? -1.0 : 1.0) * (i == 0 || i == n - 1 ? 0.5 : 1.0) / distance;
      w[i] = b;
      sum += b;
    }
    return w / sum;
  }

  /// Gauss-Legendre points and weights on [0, 1], ascending.
  void gaussRule(int points) {
    const auto add = [&](double zero) {
      const double slope = boost::math::legendre_p_prime(points, zero);
      gauss.push_back(0.5 * (1.0 + zero));
      weight.push_back(1.0 / ((1.0 - zero * zero) * slope * slope));
    };
    const std::vector<double> zeros =
        boost::math::legendre_p_zeros<double>(points);  // non-negative, ascending
    for (auto zero = zeros.rbegin(); zero != zeros.rend(); ++zero)
      if (*zero > 0.0) add(-*zero);
    for (const double zero : zeros) add(zero);
  }

  int n;
  std::vector<double> node, gauss, weight;
  std::vector<MatrixXd> lagrange;  ///< for each node: the polynomials (rows) at node times each Gauss point
  VectorXd quadrature;             ///< weights of the nodes for the integral over [0, 1]
};

/// Response of the modes over an element of one length. State of a mode: q, q'/w.
struct ElementResponse {
  double length = 0.0;
  MatrixXd motion, velocity;              ///< (n D) x 2M: from the state at the start
  MatrixXd force_motion, force_velocity;  ///< (n D) x (n D)
  MatrixXd state, force_state;            ///< 2M x 2M, 2M x (n D): state at the end
};

/// Pole -a + i wd of a mode, with modulus w.
struct Pole {
  explicit Pole(const SystemMode& mode)
      : w(units::TWO_PI * mode.frequency),
        a(mode.damping_ratio * w),
        wd(w * std::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio)) {}

  /// Free motion of q and q'/w over a time.
  Eigen::Matrix2d flow(double t) const {
    const double e = std::exp(-a * t), co = std::cos(wd * t), si = std::sin(wd * t);
    Eigen::Matrix2d flow;
    flow << e * (co + a / wd * si), e * w / wd * si, -e * w / wd * si, e * (co - a / wd * si);
    return flow;
  }

  double w, a, wd;
};

/// Motion and velocity at the nodes (rows) for a unit of each polynomial of the force (columns).
struct NodeResponse {
  MatrixXd motion, velocity;
};

NodeResponse nodeResponse(const Pole& pole, const Reference& reference, double length) {
  const Index n = reference.n;
  MatrixXd re(n, n), im(n, n);
  VectorXd wr(static_cast<Index>(reference.gauss.size())), wi(wr.size());
  // integral of exp(s (t_i - t)) l_j(t) from 0 to t_i, s = -a + i wd.
  for (Index i = 0; i < n; ++i) {
    const double t = length * reference.node[static_cast<std::size_t>(i)];
    for (Index q = 0; q < wr.size(); ++q) {
      const double rest = t * (1.0 - reference.gauss[static_cast<std::size_t>(q)]);
      const double e = std::exp(-pole.a * rest) * t * reference.weight[static_cast<std::size_t>(q)];
      wr[q] = e * std::cos(pole.wd * rest);
      wi[q] = e * std::sin(pole.wd * rest);
    }
    re.row(i).noalias() = (reference.lagrange[static_cast<std::size_t>(i)] * wr).transpose();
    im.row(i).noalias() = (reference.lagrange[static_cast<std::size_t>(i)] * wi).transpose();
  }
  return {im / pole.wd, re - (pole.a / pole.wd) * im};
}

/// Adds the response of a mode. @param c first of its two columns of the state
void addMode(ElementResponse& response, const SystemMode& mode, const Axes& axes, const Reference& reference,
             Index c) {
  const Index n = reference.n, d = axes.count();
  const bool with_velocity = response.velocity.size() > 0;
  const Pole pole(mode);
  const NodeResponse node = nodeResponse(pole, reference, response.length);
  for (Index i = 0; i < n; ++i) {
    const Eigen::Matrix2d flow = pole.flow(response.length * reference.node[static_cast<std::size_t>(i)]);
    for (Index p = 0; p < d; ++p) {
      const double out = mode.output[axes.index[static_cast<std::size_t>(p)]];
      response.motion.block<1, 2>(i * d + p, c) = out * flow.row(0);
      if (with_velocity) response.velocity.block<1, 2>(i * d + p, c) = out * pole.w * flow.row(1);
      for (Index r = 0; r < d; ++r) {
        const double gain = out * mode.input[axes.index[static_cast<std::size_t>(r)]];
        if (gain == 0.0) continue;
        for (Index j = 0; j < n; ++j) {
          response.force_motion(i * d + p, j * d + r) += gain * node.motion(i, j);
          if (with_velocity) response.force_velocity(i * d + p, j * d + r) += gain * node.velocity(i, j);
        }
      }
    }
    if (i + 1 == n) response.state.block<2, 2>(c, c) = flow;
  }
  for (Index r = 0; r < d; ++r) {
    const double in = mode.input[axes.index[static_cast<std::size_t>(r)]];
    for (Index j = 0; j < n; ++j) {
      response.force_state(c, j * d + r) = in * node.motion(n - 1, j);
      response.force_state(c + 1, j * d + r) = in * node.velocity(n - 1, j) / pole.w;
    }
  }
}

ElementResponse elementResponse(const std::vector<SystemMode>& modes, const Axes& axes,
                                const Reference& reference, double length, bool with_velocity) {
  const Index nd = reference.n * axes.count(), m2 = 2 * static_cast<Index>(modes.size());
  ElementResponse response;
  response.length = length;
  response.motion = MatrixXd::Zero(nd, m2);
  response.force_motion = MatrixXd::Zero(nd, nd);
  response.state = MatrixXd::Zero(m2, m2);
  response.force_state = MatrixXd::Zero(m2, nd);
  if (with_velocity) {
    response.velocity = response.motion;
    response.force_velocity = response.force_motion;
  }
  for (std::size_t k = 0; k < modes.size(); ++k)
    addMode(response, modes[k], axes, reference, 2 * static_cast<Index>(k));
  return response;
}

/// [rad/s] Fastest vibration that the elements resolve. @param stiffness [N/m] of the feedback
double fastestOf(const std::vector<SystemMode>& modes, double stiffness) {
  double fastest = 0.0;
  // A heavily damped mode far above the others represents a residual compliance and follows the force
  // immediately.
  constexpr double HEAVY_DAMPING = 0.4;
  for (const SystemMode& mode : modes) {
    if (mode.damping_ratio >= HEAVY_DAMPING && modes.size() > 1) continue;
    const double w = units::TWO_PI * mode.frequency;
    const double added =
        stiffness * std::hypot(mode.input[0], mode.input[1]) * std::hypot(mode.output[0], mode.output[1]);
    fastest = std::max(fastest, std::sqrt(w * w + added));
  }
  return fastest;
}

/// Responses for every length up to the longest as Chebyshev series in the length. All entries are sums of
/// exponentials of the length, so the terms decrease as (r / 2)^k / k!, with r the largest pole times half
/// the longest length.
class ResponseTable {
 public:
  ResponseTable(const std::vector<SystemMode>& modes, const Reference& reference, bool with_velocity)
      : longest_(PHASE / fastestOf(modes, 0.0)),
        example_(elementResponse(modes, Axes(modes), reference, longest_, with_velocity)) {
    constexpr double ERROR = 1e-9;
    double half = 0.0, term = 1.0;
    for (const SystemMode& mode : modes)
      half = std::max(half, 0.5 * units::TWO_PI * mode.frequency * longest_);
    int terms = 0;
    while (term > ERROR || terms < half) term *= 0.5 * half / ++terms;
    MatrixXd values(pack(example_).size(), terms), cosines(terms, terms);
    for (int k = 0; k < terms; ++k) {
      const double angle = units::PI * (k + 0.5) / terms;
      values.col(k) = pack(elementResponse(modes, Axes(modes), reference,
                                           0.5 * longest_ * (1.0 + std::cos(angle)), with_velocity));
      for (int j = 0; j < terms; ++j) cosines(k, j) = (j == 0 ? 1.0 : 2.0) / terms * std::cos(j * angle);
    }
    coefficients_ = values * cosines;
  }

  double longest() const { return longest_; }

  ElementResponse at(double length) const {
    VectorXd series(coefficients_.cols());
    const double x = 2.0 * length / longest_ - 1.0;
    for (Index j = 0; j < series.size(); ++j)
      series[j] = j == 0 ? 1.0 : j == 1 ? x : 2.0 * x * series[j - 1] - series[j - 2];
    const VectorXd all = coefficients_ * series;
    ElementResponse response = example_;
    response.length = length;
    Index at = 0;
    for (MatrixXd ElementResponse::*part : PARTS) {
      MatrixXd& matrix = response.*part;
      matrix = Eigen::Map<const MatrixXd>(all.data() + at, matrix.rows(), matrix.cols());
      at += matrix.size();
    }
    return response;
  }

 private:
  static constexpr MatrixXd ElementResponse::*PARTS[] = {
      &ElementResponse::motion,         &ElementResponse::velocity, &ElementResponse::force_motion,
      &ElementResponse::force_velocity, &ElementResponse::state,    &ElementResponse::force_state};

  static VectorXd pack(const ElementResponse& response) {
    Index size = 0;
    for (MatrixXd ElementResponse::*part : PARTS) size += (response.*part).size();
    VectorXd all(size);
    size = 0;
    for (MatrixXd ElementResponse::*part : PARTS) {
      const MatrixXd& matrix = response.*part;
      all.segment(size, matrix.size()) = Eigen::Map<const VectorXd>(matrix.data(), matrix.size());
      size += matrix.size();
    }
    return all;
  }

  double longest_;
  ElementResponse example_;  ///< provides the sizes of the matrices
  MatrixXd coefficients_;    ///< entries x terms
};

/// Cache of the responses at one speed; without helix they are the same at every depth.
class ResponseCache {
 public:
  ResponseCache(const std::vector<SystemMode>& of_modes, std::shared_ptr<const Reference> of_reference,
                bool velocities, std::shared_ptr<const ResponseTable> of_table = nullptr)
      : modes(of_modes),
        axes(of_modes),
        reference(std::move(of_reference)),
        with_velocity(velocities),
        table_(std::move(of_table)) {}

  std::shared_ptr<const ElementResponse> of(double length) {
    for (const auto& response : cached_)
      if (std::abs(response->length - length) <= 1e-13 * length) return response;
    constexpr std::size_t MOST = 100;
    if (cached_.size() >= MOST) cached_.clear();
    cached_.push_back(std::make_shared<ElementResponse>(
        table_ && length <= table_->longest()
            ? table_->at(length)
            : elementResponse(modes, axes, *reference, length, with_velocity)));
    return cached_.back();
  }

  std::vector<SystemMode> modes;
  Axes axes;
  std::shared_ptr<const Reference> reference;
  bool with_velocity;
  Index expected = 0;  ///< number of applications for the last eigenvalue
  double eigenvalue_tolerance = EIGENVALUE_TOLERANCE;

 private:
  std::shared_ptr<const ResponseTable> table_;
  std::vector<std::shared_ptr<const ElementResponse>> cached_;
};

/// The map over one period of [state; motion at the nodes that is needed with a delay in the next period].
class PeriodMap {
 public:
  PeriodMap(const DelayedSystem& system, ResponseCache& responses)
      : d_(responses.axes.count()),
        n_(responses.reference->n),
        m2_(2 * static_cast<Index>(system.modes.size())),
        reference_(*responses.reference),
        period_(system.period),
        responses_(responses) {
    mesh(system);
    for (Element& element : elements_) fill(system, responses, element);
    size_ = m2_;
    for (Element& element : elements_) {
      if (!element.needed_next_period) continue;
      element.slot = size_;
      size_ += n_ * d_;
    }
    motion_.resize(elements_.size());
  }

  Index size() const { return size_; }

  void apply(const VectorXd& in, VectorXd& out) { march(in, out, false); }

  Dominant dominant(bool with_vector) {
    return dominantEigenvalue([this](const VectorXd& in, VectorXd& out) { apply(in, out); }, size_,
                              responses_.eigenvalue_tolerance, with_vector, responses_.expected);
  }

  /// [Hz] Strongest Fourier component of the motion of an eigenvector. @param highest [rad/s]
  double strongest(const Dominant& mode, double highest) {
    VectorXd out(size_);
    std::vector<Eigen::VectorXcd> motion(elements_.size());
    march(mode.vector.real(), out, true);
    for (std::size_t e = 0; e < elements_.size(); ++e) motion[e] = motion_[e].cast<Complex>();
    march(mode.vector.imag(), out, true);
    for (std::size_t e = 0; e < elements_.size(); ++e)
      motion[e] += Complex(0, 1) * motion_[e].cast<Complex>();
    const double base = std::arg(mode.value) / period_, step = units::TWO_PI / period_;
    const int most = std::min(400, static_cast<int>(highest / step) + 2);
    double best = -1.0, frequency = 0.0;
    for (int k = -most; k <= most; ++k) {
      const double w = base + k * step;
      Eigen::VectorXcd sum = Eigen::VectorXcd::Zero(d_);
      for (std::size_t e = 0; e < elements_.size(); ++e) {
        const Element& element = elements_[e];
        for (Index i = 0; i < n_; ++i) {
          const double t = element.begin + element.length * reference_.node[static_cast<std::size_t>(i)];
          sum += element.length * reference_.quadrature[i] * std::polar(1.0, -w * t) *
                 motion[e].segment(i * d_, d_);
        }
      }
      if (sum.norm() > best) {
        best = sum.norm();
        frequency = std::abs(w) / units::TWO_PI;
      }
    }
    return frequency;
  }

 private:
  /// Source of the delayed motion at a node.
  struct Source {
    std::size_t element = 0;
    bool previous = true;  ///< in the previous period
    VectorXd weights;      ///< of the nodes of that element; empty: the same node
  };

  struct Element {
    double begin = 0.0, length = 0.0;
    std::shared_ptr<const ElementResponse> response;
    bool cuts = false, needed = false, needed_next_period = false;
    Index slot = 0;
    /// If the delay is the period: [state at the end; motion at the nodes] from [state; motion one period
    /// ago]. Otherwise empty, and the members below are used.
    MatrixXd step;
    MatrixXd from_state;                         // (n D) x 2M
    Eigen::PartialPivLU<MatrixXd> lu;            // of I - feedback x response
    std::vector<std::vector<MatrixXd>> delayed;  // [delay][node] D x D, empty where zero
    std::vector<std::vector<Source>> source;     // [delay][node]; one entry: the whole element
  };

  void mesh(const DelayedSystem& system) {
    std::vector<double> ends = system.breaks;
    ends.push_back(0.0);
    ends.push_back(period_);
    std::sort(ends.begin(), ends.end());
    const double fastest = fastestOf(system.modes, system.stiffness);
    const double shortest_delay = *std::min_element(system.delays.begin(), system.delays.end());
    double begin = 0.0;
    for (const double end : ends) {
      const double length = end - begin;
      if (length < 1e-10 * period_) continue;
      const double parts = std::ceil(
          std::max((fastest + system.rate) * length / PHASE, length / shortest_delay * (1.0 - 1e-12)));
      for (int p = 0; p < static_cast<int>(parts); ++p) {
        Element element;
        element.begin = begin + length * p / parts;
        element.length = length / parts;
        elements_.push_back(element);
      }
      begin = end;
    }
  }

  Source find(double t, std::size_t self) {
    Source source;
    source.previous = t < -1e-12 * period_;
    if (source.previous) t += period_;
    std::size_t e = 0;
    while (e + 1 < elements_.size() && elements_[e + 1].begin <= t) ++e;
    // Rounding must not make an element its own source.
    if (!source.previous && e >= self && e > 0) e = self - 1;
    source.element = e;
    source.weights = reference_.weights(std::clamp((t - elements_[e].begin) / elements_[e].length, 0.0, 1.0));
    elements_[e].needed = true;
    if (source.previous) elements_[e].needed_next_period = true;
    return source;
  }

  void fill(const DelayedSystem& system, ResponseCache& responses, Element& element) {
    element.response = responses.of(element.length);
    const ElementResponse& response = *element.response;
    const auto self = static_cast<std::size_t>(&element - elements_.data());
    const auto reduced = [&](const Eigen::Matrix2d& full) { return responses.axes.reduced(full); };
    const double inside = element.begin + 0.5 * element.length;
    std::vector<Feedback> at(static_cast<std::size_t>(n_));
    for (Index i = 0; i < n_; ++i) {
      Feedback& f = at[static_cast<std::size_t>(i)];
      system.feedback(element.begin + element.length * reference_.node[static_cast<std::size_t>(i)], inside,
                      f);
      element.cuts |=
          !f.now.isZero(0.0) || !f.velocity.isZero(0.0) ||
          std::any_of(f.delayed.begin(), f.delayed.end(), [](const auto& m) { return !m.isZero(0.0); });
    }
    if (!element.cuts) return;
    MatrixXd matrix = MatrixXd::Identity(n_ * d_, n_ * d_);
    element.from_state = MatrixXd::Zero(n_ * d_, m2_);
    for (Index i = 0; i < n_; ++i) {
      const Feedback& f = at[static_cast<std::size_t>(i)];
      const MatrixXd now = reduced(f.now);
      element.from_state.middleRows(i * d_, d_).noalias() = now * response.motion.middleRows(i * d_, d_);
      matrix.middleRows(i * d_, d_).noalias() -= now * response.force_motion.middleRows(i * d_, d_);
      if (!f.velocity.isZero(0.0)) {
        const MatrixXd velocity = reduced(f.velocity);
        element.from_state.middleRows(i * d_, d_).noalias() +=
            velocity * response.velocity.middleRows(i * d_, d_);
        matrix.middleRows(i * d_, d_).noalias() -= velocity * response.force_velocity.middleRows(i * d_, d_);
      }
    }
    element.lu.compute(matrix);
    element.delayed.resize(system.delays.size());
    element.source.resize(system.delays.size());
    for (std::size_t k = 0; k < system.delays.size(); ++k) {
      bool any = false;
      for (const Feedback& f : at) any |= !f.delayed[k].isZero(0.0);
      if (!any) continue;
      for (const Feedback& f : at) element.delayed[k].push_back(reduced(f.delayed[k]));
      if (std::abs(system.delays[k] - period_) <= 1e-12 * period_) {
        Source same;
        same.element = self;
        element.source[k].push_back(same);
        element.needed = element.needed_next_period = true;
        if (system.delays.size() == 1) condense(element);
        continue;
      }
      for (Index i = 0; i < n_; ++i) {
        const double t = element.begin + element.length * reference_.node[static_cast<std::size_t>(i)];
        element.source[k].push_back(find(t - system.delays[k], self));
      }
    }
  }

  void condense(Element& element) {
    const ElementResponse& response = *element.response;
    const Index nd = n_ * d_;
    MatrixXd force(nd, m2_ + nd);
    force.leftCols(m2_) = element.from_state;
    force.rightCols(nd).setZero();
    for (Index i = 0; i < n_; ++i)
      force.block(i * d_, m2_ + i * d_, d_, d_) = element.delayed.front()[static_cast<std::size_t>(i)];
    force = element.lu.solve(force).eval();
    element.step.resize(m2_ + nd, m2_ + nd);
    element.step.topRows(m2_).noalias() = response.force_state * force;
    element.step.bottomRows(nd).noalias() = response.force_motion * force;
    element.step.topLeftCorner(m2_, m2_) += response.state;
    element.step.bottomLeftCorner(nd, m2_) += response.motion;
  }

  void march(const VectorXd& in, VectorXd& out, bool everywhere) {
    out.resize(size_);
    state_ = in.head(m2_);
    for (std::size_t e = 0; e < elements_.size(); ++e) {
      const Element& element = elements_[e];
      const ElementResponse& response = *element.response;
      if (element.step.size() > 0) {
        before_.resize(m2_ + n_ * d_);
        before_ << state_, in.segment(element.slot, n_ * d_);
        after_.noalias() = element.step * before_;
        state_ = after_.head(m2_);
        motion_[e] = after_.tail(n_ * d_);
        continue;
      }
      const bool needed = everywhere || element.needed;
      if (needed) motion_[e].noalias() = response.motion * state_;
      if (element.cuts) {
        force_.noalias() = element.from_state * state_;
        for (std::size_t k = 0; k < element.delayed.size(); ++k) {
          if (element.delayed[k].empty()) continue;
          for (Index i = 0; i < n_; ++i) {
            const auto node = static_cast<std::size_t>(i);
            const Source& source = element.source[k][element.source[k].size() == 1 ? 0 : node];
            const double* values =
                source.previous ? in.data() + elements_[source.element].slot : motion_[source.element].data();
            if (source.weights.size() == 0) {
              for (Index p = 0; p < d_; ++p) delayed_[p] = values[i * d_ + p];
            } else {
              delayed_[0] = delayed_[1] = 0.0;
              for (Index l = 0; l < n_; ++l)
                for (Index p = 0; p < d_; ++p) delayed_[p] += source.weights[l] * values[l * d_ + p];
            }
            const MatrixXd& gain = element.delayed[k][node];
            for (Index p = 0; p < d_; ++p)
              for (Index r = 0; r < d_; ++r) force_[i * d_ + p] += gain(p, r) * delayed_[r];
          }
        }
        force_ = element.lu.solve(force_);
        if (needed) motion_[e].noalias() += response.force_motion * force_;
      }
      next_.noalias() = response.state * state_;
      if (element.cuts) next_.noalias() += response.force_state * force_;
      state_.swap(next_);
    }
    out.head(m2_) = state_;
    for (std::size_t e = 0; e < elements_.size(); ++e)
      if (elements_[e].needed_next_period) out.segment(elements_[e].slot, n_ * d_) = motion_[e];
  }

  Index d_, n_, m2_, size_ = 0;
  const Reference& reference_;
  double period_;
  ResponseCache& responses_;
  std::vector<Element> elements_;
  std::vector<VectorXd> motion_;
  VectorXd state_, next_, force_, before_, after_;
  double delayed_[2] = {0.0, 0.0};
};

class Collocation : public FloquetSolver {
 public:
  Collocation(const RegenerativeSystem& system, const SolverOptions& options)
      : FloquetSolver(system, options),
        reference_(std::make_shared<Reference>(options.nodes > 0 ? options.nodes : DEFAULT_NODES)),
        with_velocity_(system.damping_radial > 0.0 || system.damping_tangential > 0.0),
        table_(options.many && fastestOf(system.modes, 0.0) > 0.0
                   ? std::make_shared<ResponseTable>(system.modes, *reference_, with_velocity_)
                   : nullptr) {}

  class Speed : public AtSpeed {
   public:
    Speed(const Collocation& solver, double speed)
        : system_(solver.system_),
          speed_(speed),
          responses_(system_.modes, solver.reference_, solver.with_velocity_, solver.table_) {
      responses_.eigenvalue_tolerance = eigenvalueTolerance(solver.options_);
    }

    CharacteristicMultiplier multiplier(double depth) override {
      const DelayedSystem delayed = delayedSystem(system_, speed_, depth);
      return {PeriodMap(delayed, responses_).dominant(false).value, delayed.period};
    }

    double chatterFrequency(double depth) override {
      const DelayedSystem delayed = delayedSystem(system_, speed_, depth);
      PeriodMap map(delayed, responses_);
      return map.strongest(map.dominant(true), highestOf(system_));
    }

   private:
    RegenerativeSystem system_;
    double speed_;
    ResponseCache responses_;
  };

  std::unique_ptr<AtSpeed> at(double speed) const override { return std::make_unique<Speed>(*this, speed); }

  std::unique_ptr<FloquetSolver> refined() const override {
    SolverOptions finer = options_;
    finer.nodes = reference_->n + REFINEMENT;
    finer.estimate_error = false;
    return std::make_unique<Collocation>(system_, finer);
  }

 private:
  std::shared_ptr<const Reference> reference_;
  bool with_velocity_;
  std::shared_ptr<const ResponseTable> table_;
};

}  // namespace

std::unique_ptr<FloquetSolver> makeCollocation(const RegenerativeSystem& system,
                                               const SolverOptions& options) {
  if (options.nodes != 0 && (options.nodes < 4 || options.nodes > 40 + REFINEMENT))
    throw Error("nodes: " + std::to_string(options.nodes) + ": expected 4..40");
  return std::make_unique<Collocation>(system, options);
}

CharacteristicMultiplier collocationMultiplier(const DelayedSystem& system, int nodes) {
  if (nodes < 4 || nodes > 40) throw Error("nodes: " + std::to_string(nodes) + ": expected 4..40");
  ResponseCache responses(system.modes, std::make_shared<Reference>(nodes), true);
  return {PeriodMap(system, responses).dominant(false).value, system.period};
}

}  // namespace smartmill::stability
