#include "smartmill_kalman/harmonic_filter.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <Eigen/Core>

#include "smartmill_core/error.h"
#include "smartmill_core/modal/state_space.h"
#include "smartmill_core/units.h"
#include "smartmill_kalman/riccati.h"

namespace smartmill::kalman {
namespace {

void requirePositive(const char* key, double value) {
  if (!(value > 0.0) || !std::isfinite(value)) {
    throw Error(std::string(key) + ": " + std::to_string(value) + ", above 0 is due");
  }
}

}  // namespace

void HarmonicFilterParameters::validate() const {
  requirePositive("bandwidth", bandwidth);
  requirePositive("noise_rms", noise_rms);
  requirePositive("settling_revolutions", settling_revolutions);
  if (max_harmonics < 1 || max_harmonics > 200) {
    throw Error("max_harmonics: " + std::to_string(max_harmonics) + ", 1 .. 200 is due");
  }
}

HarmonicFilter::HarmonicFilter(const ModalModel& sensor, double spindle_speed, double sample_rate,
                               const HarmonicFilterParameters& parameters)
    : spindle_speed_(spindle_speed), modes_(sensor.modes.size()), direct_(sensor.direct) {
  parameters.validate();
  requirePositive("spindle speed [rad/s]", spindle_speed);
  requirePositive("sample rate [Hz]", sample_rate);
  const double spindle_frequency = spindle_speed / units::TWO_PI;
  const double top = std::min(parameters.bandwidth, 0.45 * sample_rate);
  harmonics_ = std::clamp(static_cast<int>(top / spindle_frequency), 1, parameters.max_harmonics);

  const auto m = static_cast<Eigen::Index>(2 * modes_);
  const Eigen::Index f = 2 * harmonics_ + 1;
  const double dt = 1.0 / sample_rate;
  const double r = parameters.noise_rms * parameters.noise_rms;
  const double tau = parameters.settling_revolutions / spindle_frequency;

  // Eq. 5.37: z = (sensor states, force states).
  const StateSpace modes = stateSpace(sensor);
  Eigen::RowVectorXd force = Eigen::RowVectorXd::Zero(f);
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(m + f, m + f);
  Eigen::MatrixXd q = Eigen::MatrixXd::Zero(m + f, m + f);
  force(0) = 1.0;
  for (Eigen::Index n = 1; n <= harmonics_; ++n) {
    force(2 * n - 1) = 1.0;
    a(m + 2 * n - 1, m + 2 * n) = static_cast<double>(n) * spindle_speed;
    a(m + 2 * n, m + 2 * n - 1) = -static_cast<double>(n) * spindle_speed;
  }
  a.topLeftCorner(m, m) = modes.a;
  a.topRightCorner(m, f) = modes.b * force;
  q.diagonal().tail(f).setConstant(r * dt / (tau * tau));
  Eigen::RowVectorXd c(m + f);
  c << modes.c, direct_ * force;

  const auto [phi, noise] = discretiseNoise(a, q, dt);
  const Eigen::MatrixXd p = stationaryCovariance(phi, noise, c, r);
  const double variance = (c * p * c.transpose())(0) + r;
  const Eigen::VectorXd gain = p * c.transpose() / variance;
  innovation_std_ = std::sqrt(variance);

  gain_.assign(gain.data(), gain.data() + gain.size());
  for (Eigen::Index k = 0; k < m; k += 2) {
    mode_transition_.insert(mode_transition_.end(),
                            {phi(k, k), phi(k, k + 1), phi(k + 1, k), phi(k + 1, k + 1)});
  }
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index j = 0; j < f; ++j) coupling_.push_back(phi(i, m + j));
  }
  for (int n = 1; n <= harmonics_; ++n) {
    rotation_.push_back(std::cos(n * spindle_speed * dt));
    rotation_.push_back(std::sin(n * spindle_speed * dt));
  }
  state_.assign(static_cast<std::size_t>(m + f), 0.0);
  next_ = state_;
}

void HarmonicFilter::reset() {
  std::fill(state_.begin(), state_.end(), 0.0);
  innovation_ = 0.0;
}

double HarmonicFilter::force() const {
  const double* f = state_.data() + 2 * modes_;
  double sum = f[0];
  for (int n = 1; n <= harmonics_; ++n) sum += f[2 * n - 1];
  return sum;
}

double HarmonicFilter::step(double measured) {
  double expected = direct_ * force();
  for (std::size_t k = 0; k < modes_; ++k) expected += state_[2 * k + 1];  // y = second state of each mode
  innovation_ = measured - expected;
  for (std::size_t i = 0; i < state_.size(); ++i) state_[i] += gain_[i] * innovation_;
  return predict();
}

double HarmonicFilter::coast() {
  innovation_ = 0.0;
  return predict();
}

double HarmonicFilter::predict() {
  const double now = force();
  const std::size_t m = 2 * modes_;
  const std::size_t f = static_cast<std::size_t>(2 * harmonics_ + 1);
  const double* force_state = state_.data() + m;
  for (std::size_t k = 0; k < modes_; ++k) {
    const double* t = mode_transition_.data() + 4 * k;
    const double* row1 = coupling_.data() + 2 * k * f;
    const double* row2 = row1 + f;
    double x1 = t[0] * state_[2 * k] + t[1] * state_[2 * k + 1];
    double x2 = t[2] * state_[2 * k] + t[3] * state_[2 * k + 1];
    for (std::size_t j = 0; j < f; ++j) {
      x1 += row1[j] * force_state[j];
      x2 += row2[j] * force_state[j];
    }
    next_[2 * k] = x1;
    next_[2 * k + 1] = x2;
  }
  next_[m] = force_state[0];
  for (int n = 1; n <= harmonics_; ++n) {
    const double c = rotation_[2 * n - 2], s = rotation_[2 * n - 1];
    const double in_phase = force_state[2 * n - 1], quadrature = force_state[2 * n];
    next_[m + 2 * n - 1] = c * in_phase + s * quadrature;
    next_[m + 2 * n] = c * quadrature - s * in_phase;
  }
  std::swap(state_, next_);
  return now;
}

}  // namespace smartmill::kalman
