#include "smartmill_kalman/filter/harmonic_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

// Vectors for the processor at hand; clang, which only reads this file, wants to see it where a function is
// declared.
#ifdef __clang__
#define AVX2_AND_DEFAULT
#else
#define AVX2_AND_DEFAULT __attribute__((target_clones("avx2", "default")))
#endif

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

/// A harmonic that a sensor passes by less is not told by it.
constexpr double LEAST_PASSED = 1e-3;

/// Steady answer of a mode's two states (StateSpace form) to a force of 1 at w [rad/s].
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
  if (parameters.max_harmonics > 0)
    harmonics = std::clamp(static_cast<int>(top * revolution), 1, parameters.max_harmonics);
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
      watch_(design_.size(), units::TWO_PI / spindle_speed * sample_rate) {
  layOut(sensor, spindle_speed);
  for (Block& block : blocks_) block.re = block.im = Four{};
  setGains();
}

void HarmonicFilter::layOut(const ModalModel& sensor, double spindle_speed) {
  sensor_ = sensor;
  spindle_speed_ = spindle_speed;
  const double dt = 1.0 / sample_rate_;
  const std::size_t pairs = modes_ + 1 + static_cast<std::size_t>(harmonics_);
  blocks_.resize((pairs + 3) / 4);
  modal_.clear();
  for (std::size_t i = 0; i < 4 * blocks_.size(); ++i) {
    Block& block = blocks_[i / 4];
    const std::size_t k = i % 4;
    block.a[k] = block.b[k] = block.c1[k] = block.c2[k] = block.g[k] = 0.0;
    if (i < modes_) {
      const Mode& mode = sensor.modes[i];
      const double wn = units::TWO_PI * mode.frequency, zeta = mode.damping_ratio;
      const double wd = wn * std::sqrt(1.0 - zeta * zeta), decay = std::exp(-zeta * wn * dt);
      block.a[k] = decay * std::cos(wd * dt);
      block.b[k] = decay * std::sin(wd * dt);
      block.c1[k] = 1.0;
      // exp of [0 -wn; wn -2 zeta wn] dt
      const double s = block.b[k] / wd;
      modal_.push_back({block.a[k] + zeta * wn * s, -wn * s, wn * s, block.a[k] - zeta * wn * s});
    } else if (i < pairs) {
      const double n = static_cast<double>(i - modes_);
      const Complex answer = sensor.response(n * spindle_speed / units::TWO_PI);
      block.a[k] = std::cos(n * spindle_speed * dt);
      block.b[k] = std::sin(n * spindle_speed * dt);
      block.c1[k] = answer.real();
      block.c2[k] = n > 0.0 ? -answer.imag() : 0.0;
      block.g[k] = 1.0;
    }
  }
  watch_.setRevolution(units::TWO_PI / spindle_speed * sample_rate_);
}

// Force states w = F - i G turn with exp(i n w dt). A mode's own pair is what it still rings: its state less
// the steady answer to the force, as (second state, what makes the pair a rotation).
std::vector<double> HarmonicFilter::toPairs(const std::vector<double>& state) const {
  std::vector<double> pairs(8 * blocks_.size(), 0.0);
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
    const Block& block = blocks_[k / 4];
    pairs[2 * k] = x2;
    pairs[2 * k + 1] = (block.a[k % 4] * x2 - modal_[k][2] * x1 - modal_[k][3] * x2) / block.b[k % 4];
  }
  return pairs;
}

std::vector<double> HarmonicFilter::state() const {
  std::vector<double> state(2 * modes_ + 1 + 2 * static_cast<std::size_t>(harmonics_));
  const auto pair = [this](std::size_t i) {
    return Complex(blocks_[i / 4].re[i % 4], blocks_[i / 4].im[i % 4]);
  };
  for (std::size_t k = 0; k < modes_; ++k) {
    const Block& block = blocks_[k / 4];
    double x2 = pair(k).real();
    double x1 = (block.a[k % 4] * x2 - block.b[k % 4] * pair(k).imag() - modal_[k][3] * x2) / modal_[k][2];
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
  for (std::size_t i = 0; i < 4 * blocks_.size(); ++i) {
    blocks_[i / 4].re[i % 4] = pairs[2 * i];
    blocks_[i / 4].im[i % 4] = pairs[2 * i + 1];
  }
  expected_ = expectation();
}

void HarmonicFilter::setGains() {
  shared_layout_.reset();
  gains_.clear();
  force_gain_.clear();
  innovation_std_.clear();
  for (const HarmonicGain& design : design_) {
    const std::vector<double> pairs = toPairs(design.filter);
    std::vector<GainBlock> gain(blocks_.size());
    double force = 0.0;
    for (std::size_t i = 0; i < 4 * blocks_.size(); ++i) {
      gain[i / 4].re[i % 4] = pairs[2 * i];
      gain[i / 4].im[i % 4] = pairs[2 * i + 1];
      force += blocks_[i / 4].g[i % 4] * pairs[2 * i];
    }
    gains_.push_back(std::move(gain));
    force_gain_.push_back(force);
    innovation_std_.push_back(std::sqrt(design.variance));
  }
}

void HarmonicFilter::retune(const ModalModel& sensor, double spindle_speed) {
  if (sensor.modes.size() != modes_) throw Error("Kalman filter: the number of modes cannot change");
  const std::vector<double> now = state();
  layOut(sensor, spindle_speed);
  setState(now);
  setGains();
}

void HarmonicFilter::replaceModes(const ModalModel& sensor, std::vector<HarmonicGain> gains) {
  HarmonicFilter other(std::move(gains), sensor, spindle_speed_, sample_rate_);
  const std::vector<Complex> seen = measuredHarmonics();
  for (std::size_t n = 0; n < seen.size() && n <= static_cast<std::size_t>(other.harmonics_); ++n) {
    const Complex passed = sensor.response(static_cast<double>(n) * spindle_speed_ / units::TWO_PI);
    const Complex force = std::abs(passed) < LEAST_PASSED ? forceHarmonic(n) : seen[n] / passed;
    const std::size_t i = other.modes_ + n;
    other.blocks_[i / 4].re[i % 4] = force.real();
    other.blocks_[i / 4].im[i % 4] = n > 0 ? force.imag() : 0.0;
  }
  other.expected_ = other.expectation();
  other.watch_ = watch_;
  other.watch_.setLevels(other.design_.size());
  other.innovation_ = innovation_;
  *this = std::move(other);
}

void HarmonicFilter::replaceSensor(const ModalModel& sensor, std::vector<HarmonicGain> gains) {
  if (sensor.modes.size() != modes_) {
    if (gains.empty()) throw Error("Kalman filter: other modes ask for other gains");
    return replaceModes(sensor, std::move(gains));
  }
  for (int n = 0; n <= harmonics_; ++n) {
    const double f = n * spindle_speed_ / units::TWO_PI;
    const Complex was = sensor_.response(f), is = sensor.response(f);
    if (std::abs(is) < LEAST_PASSED) continue;
    const std::size_t i = modes_ + static_cast<std::size_t>(n);
    Block& block = blocks_[i / 4];
    const Complex force = Complex(block.re[i % 4], block.im[i % 4]) * was / is;
    block.re[i % 4] = force.real();
    block.im[i % 4] = n > 0 ? force.imag() : 0.0;
  }
  if (!gains.empty() && gains.front().filter.size() == design_.front().filter.size())
    design_ = std::move(gains);
  layOut(sensor, spindle_speed_);
  watch_.setLevels(design_.size());
  setGains();
  expected_ = expectation();
}

std::vector<std::complex<double>> HarmonicFilter::measuredHarmonics() const {
  std::vector<Complex> harmonics;
  for (int n = 0; n <= harmonics_; ++n) {
    const std::size_t i = modes_ + static_cast<std::size_t>(n);
    const Block& block = blocks_[i / 4];
    harmonics.push_back(Complex(block.c1[i % 4], -block.c2[i % 4]) *
                        Complex(block.re[i % 4], block.im[i % 4]));
  }
  return harmonics;
}

void HarmonicFilter::adopt(const HarmonicFilter& other) {
  if (other.modes_ != modes_) throw Error("Kalman filter: the number of modes cannot change");
  std::vector<double> state = other.state();
  watch_.setLevel(other.level());
  state.resize(2 * modes_ + 1 + 2 * static_cast<std::size_t>(harmonics_), 0.0);
  setState(state);
}

double HarmonicFilter::slope(double highest) const {
  // d/d angle of Re(H W), W turning with exp(i n angle): n (c2 re - c1 im).
  Four sum = {};
  const double first = -static_cast<double>(modes_);
  Four order = {first, first + 1.0, first + 2.0, first + 3.0};
  for (const Block& block : blocks_) {
    // Modes come first and do not turn with the spindle.
    Four n = order > 0.0 ? order : Four{};
    n = order > highest ? Four{} : n;
    sum += n * (block.c2 * block.re - block.c1 * block.im);
    order += 4.0;
  }
  return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

double HarmonicFilter::expectation() const {
  double sum = 0.0;
  for (const Block& block : blocks_) {
    for (int k = 0; k < 4; ++k) sum += block.c1[k] * block.re[k] + block.c2[k] * block.im[k];
  }
  return sum;
}

void HarmonicFilter::reset() {
  for (Block& block : blocks_) block.re = block.im = Four{};
  expected_ = innovation_ = 0.0;
  watch_.reset();
}

// Without fused multiply-adds the clones give the same numbers.
AVX2_AND_DEFAULT double HarmonicFilter::advance(const GainBlock* gain, double innovation, double force_gain) {
  const Four nu = {innovation, innovation, innovation, innovation};
  Four force = {}, expected = {};
  Block* block = blocks_.data();
  for (const Block* end = block + blocks_.size(); block != end; ++block, ++gain) {
    force += block->g * block->re;
    const Four re = block->re + gain->re * nu, im = block->im + gain->im * nu;
    const Four next_re = block->a * re - block->b * im, next_im = block->b * re + block->a * im;
    expected += block->c1 * next_re + block->c2 * next_im;
    block->re = next_re;
    block->im = next_im;
  }
  expected_ = (expected[0] + expected[2]) + (expected[1] + expected[3]);
  return (force[0] + force[2]) + (force[1] + force[3]) + force_gain * innovation;
}

std::vector<double> HarmonicFilter::smooth(const std::vector<double>& measured) {
  const std::size_t slow = gains_.size() - 1;
  std::vector<double> force, innovation;
  force.reserve(measured.size());
  innovation.reserve(measured.size());
  for (const double sample : measured) {
    innovation.push_back(sample - expected_);
    force.push_back(advance(gains_[slow].data(), innovation.back(), 0.0));
  }
  const std::shared_ptr<const Layout> fixed = layout();
  std::vector<GainBlock> lambda(blocks_.size(), GainBlock{});
  for (std::size_t at = measured.size(); at-- > 0;)
    force[at] += goBack(*fixed, slow, innovation[at], true, lambda);
  return force;
}

std::shared_ptr<const HarmonicFilter::Layout> HarmonicFilter::layout() const {
  if (!shared_layout_) {
    auto made = std::make_shared<Layout>();
    made->blocks = blocks_;
    made->gains = gains_;
    made->force_gain = force_gain_;
    for (const HarmonicGain& design : design_) {
      const std::vector<double> pairs = toPairs(design.smoothing);
      made->smoothing.emplace_back(blocks_.size());
      for (std::size_t i = 0; i < 4 * blocks_.size(); ++i) {
        made->smoothing.back()[i / 4].re[i % 4] = pairs[2 * i];
        made->smoothing.back()[i / 4].im[i % 4] = pairs[2 * i + 1];
      }
      made->variance.push_back(design.variance);
    }
    shared_layout_ = std::move(made);
  }
  return shared_layout_;
}

// lambda(k) = c' nu / S + (I - c' K') Phi' lambda(k + 1); force smoothed = force predicted + (P d')' lambda.
AVX2_AND_DEFAULT double HarmonicFilter::goBack(const Layout& layout, std::size_t level, double innovation,
                                               bool seen, std::vector<GainBlock>& lambda) {
  const std::vector<GainBlock>&gain = layout.gains[level], &smoothing = layout.smoothing[level];
  Four through = {}, correction = {};
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    const Block& block = layout.blocks[i];
    const Four re = lambda[i].re, im = lambda[i].im;
    lambda[i].re = block.a * re + block.b * im;
    lambda[i].im = block.a * im - block.b * re;
    through += gain[i].re * lambda[i].re + gain[i].im * lambda[i].im;
  }
  const double taken = (through[0] + through[2]) + (through[1] + through[3]);
  const double drive = seen ? innovation / layout.variance[level] - taken : 0.0;
  for (std::size_t i = 0; i < lambda.size(); ++i) {
    lambda[i].re += layout.blocks[i].c1 * drive;
    lambda[i].im += layout.blocks[i].c2 * drive;
    correction += smoothing[i].re * lambda[i].re + smoothing[i].im * lambda[i].im;
  }
  return (correction[0] + correction[2]) + (correction[1] + correction[3]);
}

}  // namespace smartmill::kalman
