#include "smartmill_kalman/filter/harmonic_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include "avx2_clones.h"
#include "smartmill_core/error.h"
#include "smartmill_core/require.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

/// Transmissibility [1] below which a harmonic cannot be estimated.
constexpr double MIN_TRANSMISSION = 1e-3;

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
    // A time constant for the quickest that all share makes the process noise uniform.
    const double quickest = parameters.uniform_noise ? memory : quick;
    gains.push_back(designHarmonicGain(sensor, spindle_speed, sample_rate, harmonics, parameters.noise_rms,
                                       memory * revolution, quickest * revolution));
  }
  return gains;
}

HarmonicFilter::HarmonicFilter(const ModalModel& sensor, double spindle_speed, double sample_rate,
                               const HarmonicFilterParameters& parameters)
    : HarmonicFilter(designGains(sensor, spindle_speed, sample_rate, parameters), sensor, spindle_speed,
                     sample_rate) {
  setWeighting(parameters.weighted);
}

HarmonicFilter::HarmonicFilter(std::vector<HarmonicGain> gains, const ModalModel& sensor,
                               double spindle_speed, double sample_rate)
    : pairs_(sensor, spindle_speed, sample_rate,
             static_cast<int>(gains.at(0).filter.size() - 2 * sensor.modes.size() - 1) / 2),
      design_(std::move(gains)),
      revolution_(static_cast<std::size_t>(std::ceil(units::TWO_PI / spindle_speed * sample_rate))),
      memory_(design_.size(), units::TWO_PI / spindle_speed * sample_rate) {
  setGains();
}

void HarmonicFilter::setModel(const ModalModel& sensor, double spindle_speed) {
  pairs_.setModel(sensor, spindle_speed);
  const double revolution = units::TWO_PI / spindle_speed * pairs_.sampleRate();
  memory_.setRevolution(revolution);
  revolution_ = static_cast<std::size_t>(std::ceil(revolution));
}

void HarmonicFilter::setState(const std::vector<double>& state) {
  pairs_.setState(state);
  predicted_output_ = pairs_.output();
}

void HarmonicFilter::setGains() {
  smoother_.reset();
  gains_.clear();
  innovation_std_.clear();
  for (const HarmonicGain& design : design_) {
    gains_.push_back(pairs_.toPairs(design.filter));
    innovation_std_.push_back(std::sqrt(design.variance));
  }
  if (weights_.size() != pairs_.batches().size()) {
    resetWeights();
  } else {
    force_gain_ = forceGains(weights_);
  }
}

std::vector<HarmonicFilter::WeightBatch> HarmonicFilter::unitWeights() const {
  std::vector<WeightBatch> weights;
  for (const HarmonicPairs::PairBatch& batch : pairs_.batches()) weights.push_back({batch.g});
  return weights;
}

void HarmonicFilter::resetWeights() {
  weights_ = unitWeights();
  weighted_ = false;
  force_gain_ = forceGains(weights_);
}

std::vector<double> HarmonicFilter::forceGains(const std::vector<WeightBatch>& weights) const {
  std::vector<double> gains;
  for (const std::vector<GainBatch>& gain : gains_) {
    double force = 0.0;
    for (std::size_t i = 0; i < 4 * weights.size(); ++i)
      force += weights[i / 4].g[i % 4] * gain[i / 4].re[i % 4];
    gains.push_back(force);
  }
  return gains;
}

// The stationary covariance p of both parts of a harmonic, noise and wander as designed, follows from its
// gain K = p H / S, with the variance S of the innovations as measured: in a cut a sensor is noisier than at
// the taps. The mean square of its error in the force is p, that of the estimate |a|^2 / 2.
void HarmonicFilter::endRevolution() {
  const double variance = innovation_sum_ / static_cast<double>(innovation_count_);  // [N2]
  innovation_sum_ = 0.0;
  innovation_count_ = 0;
  if (!weighting_ || !memory_.settled()) return;
  for (std::size_t n = 1; n <= static_cast<std::size_t>(pairs_.harmonics()); ++n) {
    const std::size_t i = pairs_.modes() + n;
    const HarmonicPairs::PairBatch& batch = pairs_.batches()[i / 4];
    const GainBatch& gain = gains_[memory_.level()][i / 4];
    const double response = std::hypot(batch.c1[i % 4], batch.c2[i % 4]);
    const double covariance = std::hypot(gain.re[i % 4], gain.im[i % 4]) * variance / response;
    weights_[i / 4].g[i % 4] = std::max(0.0, 1.0 - 2.0 * covariance / std::norm(pairs_.forceHarmonic(n)));
  }
  weighted_ = true;
  force_gain_ = forceGains(weights_);
}

void HarmonicFilter::retune(const ModalModel& sensor, double spindle_speed) {
  if (sensor.modes.size() != pairs_.modes())
    throw Error("Kalman filter: number of modes differs from that of the filter");
  const std::vector<double> now = pairs_.state();
  setModel(sensor, spindle_speed);
  setState(now);
  setGains();
}

void HarmonicFilter::replaceModes(const ModalModel& sensor, std::vector<HarmonicGain> gains) {
  const double speed = pairs_.spindleSpeed();
  HarmonicFilter other(std::move(gains), sensor, speed, pairs_.sampleRate());
  const std::vector<Complex> measured = pairs_.measuredHarmonics();
  for (std::size_t n = 0; n < measured.size() && n <= static_cast<std::size_t>(other.pairs_.harmonics());
       ++n) {
    const Complex gain = sensor.response(static_cast<double>(n) * speed / units::TWO_PI);
    other.pairs_.setForceHarmonic(
        n, std::abs(gain) < MIN_TRANSMISSION ? pairs_.forceHarmonic(n) : measured[n] / gain);
  }
  other.predicted_output_ = other.pairs_.output();
  other.memory_ = memory_;
  other.memory_.setLevels(other.design_.size());
  other.innovation_ = innovation_;
  *this = std::move(other);
}

void HarmonicFilter::replaceSensor(const ModalModel& sensor, std::vector<HarmonicGain> gains) {
  if (sensor.modes.size() != pairs_.modes()) {
    if (gains.empty()) throw Error("Kalman filter: no gains for another number of modes");
    return replaceModes(sensor, std::move(gains));
  }
  for (int n = 0; n <= pairs_.harmonics(); ++n) {
    const double f = n * pairs_.spindleSpeed() / units::TWO_PI;
    const Complex was = pairs_.sensor().response(f), is = sensor.response(f);
    if (std::abs(is) < MIN_TRANSMISSION) continue;
    const auto harmonic = static_cast<std::size_t>(n);
    pairs_.setForceHarmonic(harmonic, pairs_.forceHarmonic(harmonic) * was / is);
  }
  if (!gains.empty() && gains.front().filter.size() == design_.front().filter.size())
    design_ = std::move(gains);
  setModel(sensor, pairs_.spindleSpeed());
  memory_.setLevels(design_.size());
  setGains();
  predicted_output_ = pairs_.output();
}

void HarmonicFilter::continueFrom(const HarmonicFilter& other) {
  if (other.pairs_.modes() != pairs_.modes())
    throw Error("Kalman filter: number of modes differs from that of the filter");
  std::vector<double> state = other.pairs_.state();
  memory_.setLevel(other.memory_.level());
  state.resize(pairs_.states(), 0.0);
  setState(state);
  resetWeights();
  weighted_ = other.weighted_;
  std::copy_n(other.weights_.begin(), std::min(weights_.size(), other.weights_.size()), weights_.begin());
  force_gain_ = forceGains(weights_);
}

void HarmonicFilter::reset() {
  pairs_.reset();
  predicted_output_ = innovation_ = innovation_sum_ = 0.0;
  innovation_count_ = 0;
  memory_.reset();
  resetWeights();
}

// Without fused multiply-adds all clones give the same numbers.
AVX2_AND_DEFAULT double HarmonicFilter::advance(const GainBatch* gain, double innovation, double force_gain) {
  using Vector4 = HarmonicPairs::Vector4;
  const Vector4 nu = {innovation, innovation, innovation, innovation};
  Vector4 force = {}, expected = {};
  HarmonicPairs::PairBatch* batch = pairs_.batches().data();
  const WeightBatch* weight = weights_.data();
  for (const HarmonicPairs::PairBatch* end = batch + pairs_.batches().size(); batch != end;
       ++batch, ++gain, ++weight) {
    force += weight->g * batch->re;
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
  resetWeights();
  const std::size_t slow = gains_.size() - 1;
  std::vector<double> force, innovation;
  force.reserve(measured.size());
  innovation.reserve(measured.size());
  for (const double sample : measured) {
    innovation.push_back(sample - predicted_output_);
    force.push_back(advance(gains_[slow].data(), innovation.back(), 0.0));
  }
  const std::shared_ptr<const HarmonicSmoother> fixed = smoother();
  std::vector<GainBatch> lambda(pairs_.batches().size(), GainBatch{});
  for (std::size_t at = measured.size(); at-- > 0;)
    force[at] += fixed->backward(slow, innovation[at], true, lambda);
  return force;
}

std::shared_ptr<const HarmonicSmoother> HarmonicFilter::smoother() const {
  if (!smoother_) {
    auto made = std::make_shared<HarmonicSmoother>();
    made->batches = pairs_.batches();
    made->gains = gains_;
    made->force_gain = forceGains(unitWeights());
    for (const HarmonicGain& design : design_) {
      made->smoothing.push_back(pairs_.toPairs(design.smoothing));
      made->variance.push_back(design.variance);
    }
    smoother_ = std::move(made);
  }
  return smoother_;
}

}  // namespace smartmill::kalman
