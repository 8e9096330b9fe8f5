#include "smartmill_kalman/filter/delay_filter.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/math/linear_algebra.h"
#include "smartmill_core/modal/state_space.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

/// Length of the buffer in which the line moves, in lines.
constexpr std::size_t BUFFER_LINES = 8;

/// Coefficients of u^i, lowest first, of the polynomial that is 1 at node j and 0 at the others.
std::vector<double> lagrangePolynomial(const std::vector<double>& nodes, std::size_t j) {
  std::vector<double> p{1.0};
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    if (k == j) continue;
    std::vector<double> next(p.size() + 1, 0.0);
    const double scale = 1.0 / (nodes[j] - nodes[k]);
    for (std::size_t i = 0; i < p.size(); ++i) {
      next[i + 1] += scale * p[i];
      next[i] -= scale * nodes[k] * p[i];
    }
    p = std::move(next);
  }
  return p;
}

/// Lagrange weights of the TAPS points around a position. @return index of the first point
std::size_t interpolationAt(double position, std::vector<double>& shares) {
  constexpr std::size_t TAPS = DelayModel::TAPS;
  const auto first = static_cast<std::size_t>(std::floor(position)) - (TAPS / 2 - 1);
  for (std::size_t j = 0; j < TAPS; ++j) {
    double share = 1.0;
    const auto point = static_cast<double>(j);
    for (std::size_t k = 0; k < TAPS; ++k) {
      const auto other = static_cast<double>(k);
      if (k != j) share *= (position - static_cast<double>(first) - other) / (point - other);
    }
    shares[j] = share;
  }
  return first;
}

}  // namespace

DelayModel::DelayModel(const ModalModel& sensor, double turn, double sample_rate)
    : modes(sensor.modes.size()), direct(sensor.direct) {
  setPeriod(turn * sample_rate);
  const StateSpace continuous = stateSpace(sensor);
  const auto m = static_cast<Eigen::Index>(2 * modes);
  // x' = A x + B p(u), p a polynomial in u = t / dt: the chain z_i' = z_(i+1) makes the powers of u.
  constexpr auto HOLD_INDEX = static_cast<Eigen::Index>(HOLD);
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(m + HOLD_INDEX, m + HOLD_INDEX);
  if (m > 0) {
    a.topLeftCorner(m, m) = continuous.a / sample_rate;
    a.block(0, m, m, 1) = continuous.b / sample_rate;
  }
  for (Eigen::Index i = 0; i + 1 < HOLD_INDEX; ++i) a(m + i, m + i + 1) = 1.0;
  const Eigen::MatrixXd phi = linear::exponential(a);
  for (std::size_t k = 0; k < modes; ++k) {
    const auto i = static_cast<Eigen::Index>(2 * k);
    transition.insert(transition.end(), {phi(i, i), phi(i, i + 1), phi(i + 1, i), phi(i + 1, i + 1)});
    output.insert(output.end(), {continuous.c(0, i), continuous.c(0, i + 1)});
  }
  std::vector<double> nodes;
  for (std::size_t j = 0; j < HOLD; ++j) nodes.push_back(static_cast<double>(j) - static_cast<double>(NOW));
  drive.assign(2 * modes * HOLD, 0.0);
  for (std::size_t j = 0; j < HOLD; ++j) {
    const std::vector<double> p = lagrangePolynomial(nodes, j);
    for (std::size_t state = 0; state < 2 * modes; ++state) {
      double factorial = 1.0;
      for (std::size_t i = 0; i < HOLD; ++i) {
        // z_i(0) = i! p_i
        if (i > 0) factorial *= static_cast<double>(i);
        drive[state * HOLD + j] +=
            phi(static_cast<Eigen::Index>(state), m + static_cast<Eigen::Index>(i)) * factorial * p[i];
      }
    }
  }
}

void DelayModel::setPeriod(double samples) {
  if (!(samples >= 18.0) || samples > 1e6) {
    throw Error("delay form: a period of " + std::to_string(samples) + " samples, expected 18 .. 1e6");
  }
  period = samples;
  // The line's next element is line[line]; one period before it is line[line - T].
  line = static_cast<std::size_t>(std::ceil(samples)) + TAPS / 2;
  const double position = static_cast<double>(line) - samples;
  interpolate.resize(TAPS);
  at = interpolationAt(position, interpolate);
}

void DelayModel::step(std::vector<double>& x) const {
  double* forces = x.data() + 2 * modes;
  for (std::size_t k = 0; k < modes; ++k) {
    const double x1 = x[2 * k], x2 = x[2 * k + 1];
    double next1 = transition[4 * k] * x1 + transition[4 * k + 1] * x2;
    double next2 = transition[4 * k + 2] * x1 + transition[4 * k + 3] * x2;
    for (std::size_t j = 0; j < HOLD; ++j) {
      next1 += drive[2 * k * HOLD + j] * forces[j];
      next2 += drive[(2 * k + 1) * HOLD + j] * forces[j];
    }
    x[2 * k] = next1;
    x[2 * k + 1] = next2;
  }
  double next = 0.0;
  for (std::size_t j = 0; j < TAPS; ++j) next += interpolate[j] * forces[at + j];
  std::copy(forces + 1, forces + line, forces);
  forces[line - 1] = next;
}

double DelayModel::measured(const std::vector<double>& x) const {
  double sum = direct * x[2 * modes + NOW];
  for (std::size_t i = 0; i < 2 * modes; ++i) sum += output[i] * x[i];
  return sum;
}

std::vector<double> delayGain(const DelayModel& model, double q, double r, const DelayGainOptions& options) {
  if (!(q > 0.0) || !(r > 0.0)) throw Error("delay form: expected variances above 0");
  // Morf, Sidhu and Kailath: P(k + 1) - P(k) = m l l', n = P c'.
  std::vector<double> l(model.states(), 0.0), n = l, through(model.states());
  l.back() = 1.0;
  double m = q, variance = r;
  const auto most = static_cast<std::size_t>(options.max_revolutions * static_cast<double>(model.line));
  double rise = 0.0;  // of the innovation's variance over a revolution
  for (std::size_t step = 1; step <= most; ++step) {
    const double output = model.measured(l), before = variance;
    // l(k + 1) = (phi - phi n c / variance) l
    for (std::size_t i = 0; i < l.size(); ++i) through[i] = l[i] - n[i] * (output / before);
    for (std::size_t i = 0; i < l.size(); ++i) n[i] += m * output * l[i];
    variance += m * output * output;
    m *= before / variance;
    model.step(through);
    l.swap(through);
    rise += m * output * output;
    if (step % model.line == 0) {
      double left = 0.0;
      for (const double x : l) left += x * x;
      const bool last = step + model.line > most && rise < options.settled * variance;
      if (last || (rise < options.converged * variance &&
                   m * left < options.converged * q * static_cast<double>(model.line))) {
        for (double& gain : n) gain /= variance;
        n.push_back(variance);
        return n;
      }
      rise = 0.0;
    }
  }
  throw Error("delay form: the gain does not converge");
}

DelayFilter::DelayFilter(const ModalModel& sensor, double spindle_speed, double sample_rate,
                         const HarmonicFilterParameters& parameters)
    : sample_rate_(sample_rate),
      model_(sensor, units::TWO_PI / spindle_speed, sample_rate),
      memory_(1, units::TWO_PI / spindle_speed * sample_rate) {
  parameters.validate();
  const double r = parameters.noise_rms * parameters.noise_rms;
  HarmonicFilterParameters slower = parameters;
  slower.settling_revolutions *= DelayGainOptions().quick;
  for (std::size_t level = 0; level < HarmonicFilter::LEVELS; ++level) {
    const double memory = slower.memory(level);
    gain_.push_back(delayGain(model_, r / (memory * memory), r));
    innovation_std_.push_back(std::sqrt(gain_.back().back()));
    gain_.back().pop_back();
  }
  memory_.setLevels(gain_.size());
  modes_.resize(2 * model_.modes);
  next_.resize(2 * model_.modes);
  line_.resize(BUFFER_LINES * model_.line);
  reset();
}

void DelayFilter::reset() {
  std::fill(modes_.begin(), modes_.end(), 0.0);
  std::fill(line_.begin(), line_.end(), 0.0);
  head_ = 0;
  innovation_ = 0.0;
  memory_.reset();
}

double DelayFilter::spindleSpeed() const {
  return units::TWO_PI * sample_rate_ / model_.period;
}

void DelayFilter::retune(double spindle_speed) {
  const DelayFilter before = *this;
  model_.setPeriod(units::TWO_PI * sample_rate_ / spindle_speed);
  for (std::vector<double>& gain : gain_) {
    // The end of the line repeats the forces one period earlier, and so does its gain.
    const std::size_t first = 2 * model_.modes;
    gain.resize(std::min(gain.size(), model_.states()));
    while (gain.size() < model_.states()) {
      const std::size_t from = first + model_.at + (gain.size() - first) - model_.line;
      double next = 0.0;
      for (std::size_t j = 0; j < DelayModel::TAPS; ++j) next += model_.interpolate[j] * gain[from + j];
      gain.push_back(next);
    }
  }
  resampleFrom(before);
  memory_.setRevolution(model_.period);
}

void DelayFilter::continueFrom(const DelayFilter& other) {
  modes_ = other.modes_;
  resampleFrom(other);
  memory_.setLevel(other.level());
}

// The same force at the same angle, with another spacing of the samples.
void DelayFilter::resampleFrom(const DelayFilter& other) {
  constexpr std::size_t TAPS = DelayModel::TAPS;
  const DelayModel& was = other.model_;
  const auto first = other.line_.begin() + static_cast<std::ptrdiff_t>(other.head_);
  std::vector<double> known(first, first + static_cast<std::ptrdiff_t>(was.line));
  // Extended by the model beyond its end, so that every position has its points around it.
  while (known.size() < was.line + 2 * TAPS) {
    const std::size_t from = was.at + known.size() - was.line;
    double next = 0.0;
    for (std::size_t j = 0; j < TAPS; ++j) next += was.interpolate[j] * known[from + j];
    known.push_back(next);
  }
  line_.assign(BUFFER_LINES * model_.line, 0.0);
  head_ = 0;
  std::vector<double> share(TAPS);
  constexpr auto NOW = static_cast<double>(DelayModel::NOW);
  for (std::size_t i = 0; i < model_.line; ++i) {
    double position = NOW + (static_cast<double>(i) - NOW) * was.period / model_.period;
    if (position < 0.5 * static_cast<double>(TAPS)) position += was.period;
    if (position > static_cast<double>(was.line + TAPS)) position -= was.period;
    const std::size_t from = interpolationAt(position, share);
    for (std::size_t j = 0; j < TAPS; ++j) line_[i] += share[j] * known[from + j];
  }
}

double DelayFilter::expected() const {
  double sum = model_.direct * line_[head_ + DelayModel::NOW];
  for (std::size_t i = 0; i < modes_.size(); ++i) sum += model_.output[i] * modes_[i];
  return sum;
}

double DelayFilter::step(double measured) {
  const double innovation = measured - expected();
  const double force = advance(innovation);
  memory_.add(innovation);
  return force;
}

double DelayFilter::advance(double innovation) {
  constexpr std::size_t HOLD = DelayModel::HOLD, TAPS = DelayModel::TAPS, NOW = DelayModel::NOW;
  if (head_ + model_.line >= line_.size()) {
    std::copy(line_.end() - static_cast<std::ptrdiff_t>(model_.line), line_.end(), line_.begin());
    head_ = 0;
  }
  double* forces = line_.data() + head_;
  innovation_ = innovation;
  const double* gain = gain_[memory_.level()].data();
  for (std::size_t i = 0; i < modes_.size(); ++i) modes_[i] += gain[i] * innovation;
  gain += modes_.size();
  for (std::size_t i = 0; i < model_.line; ++i) forces[i] += gain[i] * innovation;
  const double force = forces[NOW];
  for (std::size_t k = 0; k < model_.modes; ++k) {
    const double* phi = model_.transition.data() + 4 * k;
    const double* first = model_.drive.data() + 2 * k * HOLD;
    double next1 = phi[0] * modes_[2 * k] + phi[1] * modes_[2 * k + 1];
    double next2 = phi[2] * modes_[2 * k] + phi[3] * modes_[2 * k + 1];
    for (std::size_t j = 0; j < HOLD; ++j) {
      next1 += first[j] * forces[j];
      next2 += first[HOLD + j] * forces[j];
    }
    next_[2 * k] = next1;
    next_[2 * k + 1] = next2;
  }
  modes_.swap(next_);
  double next = 0.0;
  for (std::size_t j = 0; j < TAPS; ++j) next += model_.interpolate[j] * forces[model_.at + j];
  forces[model_.line] = next;
  ++head_;
  return force;
}

}  // namespace smartmill::kalman
