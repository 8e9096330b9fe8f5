#include "smartmill_kalman/filter/harmonic_pairs.h"

#include <cmath>

#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

/// Steady-state response of a mode's two states (StateSpace form) to a unit force at w [rad/s].
std::array<Complex, 2> steady(const Mode& mode, double w) {
  const double wn = units::TWO_PI * mode.frequency;
  const Complex second = mode.response(w / units::TWO_PI);
  return {(Complex(2.0 * mode.damping_ratio * wn, w) / wn) * second, second};
}

}  // namespace

HarmonicPairs::HarmonicPairs(const ModalModel& sensor, double spindle_speed, double sample_rate,
                             int harmonics)
    : sample_rate_(sample_rate), modes_(sensor.modes.size()), harmonics_(harmonics) {
  setModel(sensor, spindle_speed);
  reset();
}

void HarmonicPairs::reset() {
  for (PairBatch& batch : batches_) batch.re = batch.im = Vector4{};
}

void HarmonicPairs::setModel(const ModalModel& sensor, double spindle_speed) {
  sensor_ = sensor;
  spindle_speed_ = spindle_speed;
  const double dt = 1.0 / sample_rate_;
  const std::size_t pairs = modes_ + 1 + static_cast<std::size_t>(harmonics_);
  batches_.resize((pairs + 3) / 4);
  modal_.clear();
  for (std::size_t i = 0; i < 4 * batches_.size(); ++i) {
    PairBatch& batch = batches_[i / 4];
    const std::size_t k = i % 4;
    batch.a[k] = batch.b[k] = batch.c1[k] = batch.c2[k] = batch.g[k] = 0.0;
    if (i < modes_) {
      const Mode& mode = sensor.modes[i];
      const double wn = units::TWO_PI * mode.frequency, zeta = mode.damping_ratio;
      const double wd = wn * std::sqrt(1.0 - zeta * zeta), decay = std::exp(-zeta * wn * dt);
      batch.a[k] = decay * std::cos(wd * dt);
      batch.b[k] = decay * std::sin(wd * dt);
      batch.c1[k] = 1.0;
      // exp of [0 -wn; wn -2 zeta wn] dt
      const double s = batch.b[k] / wd;
      modal_.push_back({batch.a[k] + zeta * wn * s, -wn * s, wn * s, batch.a[k] - zeta * wn * s});
    } else if (i < pairs) {
      const double n = static_cast<double>(i - modes_);
      const Complex response = sensor.response(n * spindle_speed / units::TWO_PI);
      batch.a[k] = std::cos(n * spindle_speed * dt);
      batch.b[k] = std::sin(n * spindle_speed * dt);
      batch.c1[k] = response.real();
      batch.c2[k] = n > 0.0 ? -response.imag() : 0.0;
      batch.g[k] = 1.0;
    }
  }
}

// Force states w = F - i G rotate by exp(i n w dt). A mode's pair is its free response, its state less the
// steady-state response to the force, as (second state, quadrature that makes the pair a rotation).
std::vector<HarmonicPairs::GainBatch> HarmonicPairs::toPairs(const std::vector<double>& state) const {
  std::vector<double> pairs(8 * batches_.size(), 0.0);
  const double* force = state.data() + 2 * modes_;
  pairs[2 * modes_] = force[0];
  for (int n = 1; n <= harmonics_; ++n) {
    pairs[2 * (modes_ + n)] = force[2 * n - 1];
    pairs[2 * (modes_ + n) + 1] = -force[2 * n];
  }
  for (std::size_t k = 0; k < modes_; ++k) {
    double x1 = state[2 * k], x2 = state[2 * k + 1];
    for (int n = 0; n <= harmonics_; ++n) {
      const Complex w(pairs[2 * (modes_ + n)], pairs[2 * (modes_ + n) + 1]);
      const auto answer = steady(sensor_.modes[k], n * spindle_speed_);
      x1 -= (answer[0] * w).real();
      x2 -= (answer[1] * w).real();
    }
    const PairBatch& batch = batches_[k / 4];
    pairs[2 * k] = x2;
    pairs[2 * k + 1] = (batch.a[k % 4] * x2 - modal_[k][2] * x1 - modal_[k][3] * x2) / batch.b[k % 4];
  }
  std::vector<GainBatch> result(batches_.size());
  for (std::size_t i = 0; i < 4 * batches_.size(); ++i) {
    result[i / 4].re[i % 4] = pairs[2 * i];
    result[i / 4].im[i % 4] = pairs[2 * i + 1];
  }
  return result;
}

std::vector<double> HarmonicPairs::state() const {
  std::vector<double> state(2 * modes_ + 1 + 2 * static_cast<std::size_t>(harmonics_));
  const auto pair = [this](std::size_t i) {
    return Complex(batches_[i / 4].re[i % 4], batches_[i / 4].im[i % 4]);
  };
  for (std::size_t k = 0; k < modes_; ++k) {
    const PairBatch& batch = batches_[k / 4];
    double x2 = pair(k).real();
    double x1 = (batch.a[k % 4] * x2 - batch.b[k % 4] * pair(k).imag() - modal_[k][3] * x2) / modal_[k][2];
    for (int n = 0; n <= harmonics_; ++n) {
      const auto answer = steady(sensor_.modes[k], n * spindle_speed_);
      x1 += (answer[0] * pair(modes_ + n)).real();
      x2 += (answer[1] * pair(modes_ + n)).real();
    }
    state[2 * k] = x1;
    state[2 * k + 1] = x2;
  }
  double* force = state.data() + 2 * modes_;
  force[0] = pair(modes_).real();
  for (int n = 1; n <= harmonics_; ++n) {
    force[2 * n - 1] = pair(modes_ + n).real();
    force[2 * n] = -pair(modes_ + n).imag();
  }
  return state;
}

void HarmonicPairs::setState(const std::vector<double>& state) {
  const std::vector<GainBatch> pairs = toPairs(state);
  for (std::size_t i = 0; i < batches_.size(); ++i) {
    batches_[i].re = pairs[i].re;
    batches_[i].im = pairs[i].im;
  }
}

std::vector<std::complex<double>> HarmonicPairs::measuredHarmonics() const {
  std::vector<Complex> harmonics;
  for (int n = 0; n <= harmonics_; ++n) {
    const std::size_t i = modes_ + static_cast<std::size_t>(n);
    const PairBatch& batch = batches_[i / 4];
    harmonics.push_back(Complex(batch.c1[i % 4], -batch.c2[i % 4]) *
                        Complex(batch.re[i % 4], batch.im[i % 4]));
  }
  return harmonics;
}

void HarmonicPairs::setForceHarmonic(std::size_t n, Complex force) {
  const std::size_t i = modes_ + n;
  batches_[i / 4].re[i % 4] = force.real();
  batches_[i / 4].im[i % 4] = n > 0 ? force.imag() : 0.0;
}

double HarmonicPairs::slope(double highest) const {
  // d/d angle of Re(H W), W turning with exp(i n angle): n (c2 re - c1 im).
  Vector4 sum = {};
  const double first = -static_cast<double>(modes_);
  Vector4 order = {first, first + 1.0, first + 2.0, first + 3.0};
  for (const PairBatch& batch : batches_) {
    // Modes come first and do not rotate with the spindle.
    Vector4 n = order > 0.0 ? order : Vector4{};
    n = order > highest ? Vector4{} : n;
    sum += n * (batch.c2 * batch.re - batch.c1 * batch.im);
    order += 4.0;
  }
  return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

double HarmonicPairs::output() const {
  double sum = 0.0;
  for (const PairBatch& batch : batches_) {
    for (int k = 0; k < 4; ++k) sum += batch.c1[k] * batch.re[k] + batch.c2[k] * batch.im[k];
  }
  return sum;
}

}  // namespace smartmill::kalman
