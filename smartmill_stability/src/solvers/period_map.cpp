#include "solvers/period_map.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::stability {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int MOST_HARMONICS = 4000;  // of a period, up to 1.5 times the highest natural frequency

}  // namespace

PeriodMap::PeriodMap(const DelayedSystem& system, ResponseCache& responses)
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

Dominant PeriodMap::dominant(bool with_vector) {
  return dominantEigenvalue([this](const VectorXd& in, VectorXd& out) { march(in, out, false); }, size_,
                            responses_.eigenvalue_tolerance, with_vector, responses_.expected);
}

double PeriodMap::strongest(const Dominant& mode, double highest) {
  VectorXd out(size_);
  std::vector<Eigen::VectorXcd> motion(elements_.size());
  march(mode.vector.real(), out, true);
  for (std::size_t e = 0; e < elements_.size(); ++e) motion[e] = motion_[e].cast<Complex>();
  march(mode.vector.imag(), out, true);
  for (std::size_t e = 0; e < elements_.size(); ++e) motion[e] += Complex(0, 1) * motion_[e].cast<Complex>();
  const double base = std::arg(mode.value) / period_, step = units::TWO_PI / period_;
  const int most = std::min(MOST_HARMONICS, static_cast<int>(highest / step) + 2);
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

void PeriodMap::mesh(const DelayedSystem& system) {
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
    const double parts = std::ceil(std::max((fastest + system.rate) * length / COLLOCATION.phase,
                                            length / shortest_delay * (1.0 - 1e-12)));
    for (int p = 0; p < static_cast<int>(parts); ++p) {
      Element element;
      element.begin = begin + length * p / parts;
      element.length = length / parts;
      elements_.push_back(element);
    }
    begin = end;
  }
}

PeriodMap::Source PeriodMap::find(double t, std::size_t self) {
  Source source;
  source.previous = t < -1e-12 * period_;
  if (source.previous) t += period_;
  const auto after = std::partition_point(elements_.begin() + 1, elements_.end(),
                                          [t](const Element& element) { return element.begin <= t; });
  auto e = static_cast<std::size_t>(after - elements_.begin()) - 1;
  // Rounding must not make an element its own source.
  if (!source.previous && e >= self && e > 0) e = self - 1;
  source.element = e;
  source.weights = reference_.weights(std::clamp((t - elements_[e].begin) / elements_[e].length, 0.0, 1.0));
  elements_[e].needed = true;
  if (source.previous) elements_[e].needed_next_period = true;
  return source;
}

void PeriodMap::fill(const DelayedSystem& system, ResponseCache& responses, Element& element) {
  element.response = responses.of(element.length);
  const ElementResponse& response = *element.response;
  const auto self = static_cast<std::size_t>(&element - elements_.data());
  const auto reduced = [&](const Eigen::Matrix2d& full) { return responses.axes.reduced(full); };
  const double inside = element.begin + 0.5 * element.length;
  std::vector<Feedback> at(static_cast<std::size_t>(n_));
  for (Index i = 0; i < n_; ++i) {
    Feedback& f = at[static_cast<std::size_t>(i)];
    system.feedback(element.begin + element.length * reference_.node[static_cast<std::size_t>(i)], inside, f);
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
    if (!system.delay && std::abs(system.delays[k] - period_) <= 1e-12 * period_) {
      Source same;
      same.element = self;
      element.source[k].push_back(same);
      element.needed = element.needed_next_period = true;
      if (system.delays.size() == 1) condense(element);
      continue;
    }
    for (Index i = 0; i < n_; ++i) {
      const double t = element.begin + element.length * reference_.node[static_cast<std::size_t>(i)];
      element.source[k].push_back(find(t - (system.delay ? system.delay(k, t) : system.delays[k]), self));
    }
  }
}

void PeriodMap::condense(Element& element) {
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

void PeriodMap::march(const VectorXd& in, VectorXd& out, bool everywhere) {
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

}  // namespace smartmill::stability
