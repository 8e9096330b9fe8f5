#include "smartmill_kalman/filter/harmonic_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

// Code for the processor in use. Clang, which only analyses this file, requires the attribute on
// declarations.
#ifdef __clang__
#define AVX2_AND_DEFAULT
#else
#define AVX2_AND_DEFAULT __attribute__((target_clones("avx2", "default")))
#endif

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

/// Transmissibility [1] below which a harmonic cannot be estimated.
constexpr double MIN_TRANSMISSION = 1e-3;

/// Steady-state response of a mode's two states (StateSpace form) to a unit force at w [rad/s].
std::array<Complex, 2> steady(const Mode& mode, double w) {
  const double wn = units::TWO_PI * mode.frequency;
  const Complex second = mode.response(w / units::TWO_PI);
  return {(Complex(2.0 * mode.damping_ratio * wn, w) / wn) * second, second};
}

}  // namespace

void HarmonicFilterParameters::validate() const {
  checkBounds(*this);
}

double HarmonicFilterParameters::memory(std::size_t level) const {
  const double slow = std::max(settling_revolutions, memory_revolutions);
  if (level == 0) return settling_revolutions;
  return level == 1 ? std::sqrt(settling_revolutions * slow) : slow;
}

std::vector<HarmonicGain> designGains(const ModalModel& sensor, double spindle_speed, double sample_rate,
                                      const HarmonicFilterParameters& parameters) {
  parameters.validate();
  require("spindle speed [rad/s]", spindle_speed, Range::positive());
  require("sample rate [Hz]", sample_rate, Range::positive());
  const double revolution = units::TWO_PI / spindle_speed;
  const double top = std::min(parameters.bandwidth, 0.45 * sample_rate);
  int harmonics = 0;
  if (parameters.max_harmonics > 0) harmonics = harmonicCount(top, revolution, parameters.max_harmonics);
  const double quick = parameters.settling_revolutions;
  std::vector<double> memories{quick};
  if (parameters.memory_revolutions > quick)
    memories.insert(memories.end(), {parameters.memory(1), parameters.memory(2)});
  std::vector<HarmonicGain> gains;
  for (const double memory : memories) {
    gains.push_back(designHarmonicGain(sensor, spindle_speed, sample_rate, harmonics, parameters.noise_rms,
                                       memory * revolution, quick * revolution));
  }
  return gains;
}

HarmonicFilter::HarmonicFilter(const ModalModel& sensor, double spindle_speed, double sample_rate,
                               const HarmonicFilterParameters& parameters)
    : HarmonicFilter(designGains(sensor, spindle_speed, sample_rate, parameters), sensor, spindle_speed,
                     sample_rate) {
}

HarmonicFilter::HarmonicFilter(std::vector<HarmonicGain> gains, const ModalModel& sensor,
                               double spindle_speed, double sample_rate)
    : sample_rate_(sample_rate),
      modes_(sensor.modes.size()),
      harmonics_(static_cast<int>(gains.at(0).filter.size() - 2 * modes_ - 1) / 2),
      design_(std::move(gains)),
      memory_(design_.size(), units::TWO_PI / spindle_speed * sample_rate) {
  setModel(sensor, spindle_speed);
  for (PairBatch& batch : batches_) batch.re = batch.im = Vector4{};
  setGains();
}

void HarmonicFilter::setModel(const ModalModel& sensor, double spindle_speed) {
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
  memory_.setRevolution(units::TWO_PI / spindle_speed * sample_rate_);
}

// Force states w = F - i G rotate by exp(i n w dt). A mode's pair is its free response, its state less the
// steady-state response to the force, as (second state, quadrature that makes the pair a rotation).
std::vector<double> HarmonicFilter::toPairs(const std::vector<double>& state) const {
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
  return pairs;
}

std::vector<double> HarmonicFilter::state() const {
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

void HarmonicFilter::setState(const std::vector<double>& state) {
  const std::vector<double> pairs = toPairs(state);
  for (std::size_t i = 0; i < 4 * batches_.size(); ++i) {
    batches_[i / 4].re[i % 4] = pairs[2 * i];
    batches_[i / 4].im[i % 4] = pairs[2 * i + 1];
  }
  predicted_output_ = predictedOutput();
}

void HarmonicFilter::setGains() {
  smoother_design_.reset();
  gains_.clear();
  force_gain_.clear();
  innovation_std_.clear();
  for (const HarmonicGain& design : design_) {
    const std::vector<double> pairs = toPairs(design.filter);
    std::vector<GainBatch> gain(batches_.size());
    double force = 0.0;
    for (std::size_t i = 0; i < 4 * batches_.size(); ++i) {
      gain[i / 4].re[i % 4] = pairs[2 * i];
      gain[i / 4].im[i % 4] = pairs[2 * i + 1];
      force += batches_[i / 4].g[i % 4] * pairs[2 * i];
    }
    gains_.push_back(std::move(gain));
    force_gain_.push_back(force);
    innovation_std_.push_back(std::sqrt(design.variance));
  }
}

void HarmonicFilter::retune(const ModalModel& sensor, double spindle_speed) {
  if (sensor.modes.size() != modes_)
    throw Error("Kalman filter: number of modes differs from that of the filter");
  const std::vector<double> now = state();
  setModel(sensor, spindle_speed);
  setState(now);
  setGains();
}

void HarmonicFilter::replaceModes(const ModalModel& sensor, std::vector<HarmonicGain> gains) {
  HarmonicFilter other(std::move(gains), sensor, spindle_speed_, sample_rate_);
  const std::vector<Complex> measured = measuredHarmonics();
  for (std::size_t n = 0; n < measured.size() && n <= static_cast<std::size_t>(other.harmonics_); ++n) {
    const Complex gain = sensor.response(static_cast<double>(n) * spindle_speed_ / units::TWO_PI);
    const Complex force = std::abs(gain) < MIN_TRANSMISSION ? forceHarmonic(n) : measured[n] / gain;
    const std::size_t i = other.modes_ + n;
    other.batches_[i / 4].re[i % 4] = force.real();
    other.batches_[i / 4].im[i % 4] = n > 0 ? force.imag() : 0.0;
  }
  other.predicted_output_ = other.predictedOutput();
  other.memory_ = memory_;
  other.memory_.setLevels(other.design_.size());
  other.innovation_ = innovation_;
  *this = std::move(other);
}

void HarmonicFilter::replaceSensor(const ModalModel& sensor, std::vector<HarmonicGain> gains) {
  if (sensor.modes.size() != modes_) {
    if (gains.empty()) throw Error("Kalman filter: no gains for another number of modes");
    return replaceModes(sensor, std::move(gains));
  }
  for (int n = 0; n <= harmonics_; ++n) {
    const double f = n * spindle_speed_ / units::TWO_PI;
    const Complex was = sensor_.response(f), is = sensor.response(f);
    if (std::abs(is) < MIN_TRANSMISSION) continue;
    const std::size_t i = modes_ + static_cast<std::size_t>(n);
    PairBatch& batch = batches_[i / 4];
    const Complex force = Complex(batch.re[i % 4], batch.im[i % 4]) * was / is;
    batch.re[i % 4] = force.real();
    batch.im[i % 4] = n > 0 ? force.imag() : 0.0;
  }
  if (!gains.empty() && gains.front().filter.size() == design_.front().filter.size())
    design_ = std::move(gains);
  setModel(sensor, spindle_speed_);
  memory_.setLevels(design_.size());
  setGains();
  predicted_output_ = predictedOutput();
}

std::vector<std::complex<double>> HarmonicFilter::measuredHarmonics() const {
  std::vector<Complex> harmonics;
  for (int n = 0; n <= harmonics_; ++n) {
    const std::size_t i = modes_ + static_cast<std::size_t>(n);
    const PairBatch& batch = batches_[i / 4];
    harmonics.push_back(Complex(batch.c1[i % 4], -batch.c2[i % 4]) *
                        Complex(batch.re[i % 4], batch.im[i % 4]));
  }
  return harmonics;
}

void HarmonicFilter::continueFrom(const HarmonicFilter& other) {
  if (other.modes_ != modes_) throw Error("Kalman filter: number of modes differs from that of the filter");
  std::vector<double> state = other.state();
  memory_.setLevel(other.level());
  state.resize(2 * modes_ + 1 + 2 * static_cast<std::size_t>(harmonics_), 0.0);
  setState(state);
}

double HarmonicFilter::slope(double highest) const {
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

double HarmonicFilter::predictedOutput() const {
  double sum = 0.0;
  for (const PairBatch& batch : batches_) {
    for (int k = 0; k < 4; ++k) sum += batch.c1[k] * batch.re[k] + batch.c2[k] * batch.im[k];
  }
  return sum;
}

void HarmonicFilter::reset() {
  for (PairBatch& batch : batches_) batch.re = batch.im = Vector4{};
  predicted_output_ = innovation_ = 0.0;
  memory_.reset();
}

// Without fused multiply-adds all clones give the same numbers.
AVX2_AND_DEFAULT double HarmonicFilter::advance(const GainBatch* gain, double innovation, double force_gain) {
  const Vector4 nu = {innovation, innovation, innovation, innovation};
  Vector4 force = {}, expected = {};
  PairBatch* batch = batches_.data();
  for (const PairBatch* end = batch + batches_.size(); batch != end; ++batch, ++gain) {
    force += batch->g * batch->re;
    const Vector4 re = batch->re + gain->re * nu, im = batch->im + gain->im * nu;
    const Vector4 next_re = batch->a * re - batch->b * im, next_im = batch->b * re + batch->a * im;
    expected += batch->c1 * next_re + batch->c2 * next_im;
    batch->re = next_re;
    batch->im = next_im;
  }
  predicted_output_ = (expected[0] + expected[2]) + (expected[1] + expected[3]);
  return (force[0] + force[2]) + (force[1] + force[3]) + force_gain * innovation;
}

std::vector<double> HarmonicFilter::smooth(const std::vector<double>& measured) {
  const std::size_t slow = gains_.size() - 1;
  std::vector<double> force, innovation;
  force.reserve(measured.size());
  innovation.reserve(measured.size());
  for (const double sample : measured) {
    innovation.push_back(sample - predicted_output_);
    force.push_back(advance(gains_[slow].data(), innovation.back(), 0.0));
  }
  const std::shared_ptr<const SmootherDesign> fixed = smootherDesign();
  std::vector<GainBatch> lambda(batches_.size(), GainBatch{});
  for (std::size_t at = measured.size(); at-- > 0;)
    force[at] += smoothBackward(*fixed, slow, innovation[at], true, lambda);
  return force;
}

std::shared_ptr<const HarmonicFilter::SmootherDesign> HarmonicFilter::smootherDesign() const {
  if (!smoother_design_) {
    auto made = std::make_shared<SmootherDesign>();
    made->batches = batches_;
    made->gains = gains_;
    made->force_gain = force_gain_;
    for (const HarmonicGain& design : design_) {
      const std::vector<double> pairs = toPairs(design.smoothing);
      made->smoothing.emplace_back(batches_.size());
      for (std::size_t i = 0; i < 4 * batches_.size(); ++i) {
        made->smoothing.back()[i / 4].re[i % 4] = pairs[2 * i];
        made->smoothing.back()[i / 4].im[i % 4] = pairs[2 * i + 1];
      }
      made->variance.push_back(design.variance);
    }
    smoother_design_ = std::move(made);
  }
  return smoother_design_;
}

// lambda(k) = c' nu / S + (I - c' K') Phi' lambda(k + 1); force smoothed = force predicted + (P d')' lambda.
AVX2_AND_DEFAULT double HarmonicFilter::smoothBackward(const SmootherDesign& design, std::size_t level,
                                                       double innovation, bool is_measured,
                                                       std::vector<GainBatch>& lambda) {
  const std::vector<GainBatch>&gain = design.gains[level], &smoothing = design.smoothing[level];
  Vector4 through = {}, correction = {};
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    const PairBatch& batch = design.batches[i];
    const Vector4 re = lambda[i].re, im = lambda[i].im;
    lambda[i].re = batch.a * re + batch.b * im;
    lambda[i].im = batch.a * im - batch.b * re;
    through += gain[i].re * lambda[i].re + gain[i].im * lambda[i].im;
  }
  const double taken = (through[0] + through[2]) + (through[1] + through[3]);
  const double drive = is_measured ? innovation / design.variance[level] - taken : 0.0;
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    lambda[i].re += design.batches[i].c1 * drive;
    lambda[i].im += design.batches[i].c2 * drive;
    correction += smoothing[i].re * lambda[i].re + smoothing[i].im * lambda[i].im;
  }
  return (correction[0] + correction[2]) + (correction[1] + correction[3]);
}

}  // namespace smartmill::kalman
