#include "solvers/element_response.h"

#include <algorithm>
#include <cmath>

#include <boost/math/special_functions/legendre.hpp>

#include "smartmill_core/units.h"

namespace smartmill::stability {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

ReferenceElement::ReferenceElement(int count) : n(count), node(static_cast<std::size_t>(count)) {
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

VectorXd ReferenceElement::weights(double x) const {
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
void ReferenceElement::gaussRule(int points) {
  const auto add = [&](double zero) {
    const double slope = boost::math::legendre_p_prime(points, zero);
    gauss.push_back(0.5 * (1.0 + zero));
    weight.push_back(1.0 / ((1.0 - zero * zero) * slope * slope));
  };
  const std::vector<double> zeros = boost::math::legendre_p_zeros<double>(points);  // non-negative, ascending
  for (auto zero = zeros.rbegin(); zero != zeros.rend(); ++zero)
    if (*zero > 0.0) add(-*zero);
  for (const double zero : zeros) add(zero);
}

namespace {

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

NodeResponse nodeResponse(const Pole& pole, const ReferenceElement& reference, double length) {
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
void addMode(ElementResponse& response, const SystemMode& mode, const Axes& axes,
             const ReferenceElement& reference, Index c) {
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
                                const ReferenceElement& reference, double length, bool with_velocity) {
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

constexpr MatrixXd ElementResponse::*PARTS[] = {
    &ElementResponse::motion,         &ElementResponse::velocity, &ElementResponse::force_motion,
    &ElementResponse::force_velocity, &ElementResponse::state,    &ElementResponse::force_state};

VectorXd pack(const ElementResponse& response) {
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

}  // namespace

double fastestOf(const std::vector<SystemMode>& modes, double stiffness) {
  double fastest = 0.0;
  for (const SystemMode& mode : modes) {
    if (mode.damping_ratio >= COLLOCATION.heavy_damping && modes.size() > 1) continue;
    const double w = units::TWO_PI * mode.frequency;
    const double added =
        stiffness * std::hypot(mode.input[0], mode.input[1]) * std::hypot(mode.output[0], mode.output[1]);
    fastest = std::max(fastest, std::sqrt(w * w + added));
  }
  return fastest;
}

ResponseTable::ResponseTable(const std::vector<SystemMode>& modes, const ReferenceElement& reference,
                             bool with_velocity)
    : longest_(COLLOCATION.phase / fastestOf(modes, 0.0)),
      example_(elementResponse(modes, Axes(modes), reference, longest_, with_velocity)) {
  double half = 0.0, term = 1.0;
  for (const SystemMode& mode : modes) half = std::max(half, 0.5 * units::TWO_PI * mode.frequency * longest_);
  int terms = 0;
  while (term > COLLOCATION.table_error || terms < half) term *= 0.5 * half / ++terms;
  MatrixXd values(pack(example_).size(), terms), cosines(terms, terms);
  for (int k = 0; k < terms; ++k) {
    const double angle = units::PI * (k + 0.5) / terms;
    values.col(k) = pack(elementResponse(modes, Axes(modes), reference,
                                         0.5 * longest_ * (1.0 + std::cos(angle)), with_velocity));
    for (int j = 0; j < terms; ++j) cosines(k, j) = (j == 0 ? 1.0 : 2.0) / terms * std::cos(j * angle);
  }
  coefficients_ = values * cosines;
}

ElementResponse ResponseTable::at(double length) const {
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

ResponseCache::ResponseCache(const std::vector<SystemMode>& of_modes,
                             std::shared_ptr<const ReferenceElement> of_reference, bool velocities,
                             std::shared_ptr<const ResponseTable> of_table)
    : modes(of_modes),
      axes(of_modes),
      reference(std::move(of_reference)),
      with_velocity(velocities),
      table_(std::move(of_table)) {
}

std::shared_ptr<const ElementResponse> ResponseCache::of(double length) {
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

}  // namespace smartmill::stability
