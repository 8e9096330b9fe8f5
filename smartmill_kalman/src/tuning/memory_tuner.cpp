#include "smartmill_kalman/tuning/memory_tuner.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "smartmill_core/axis_names.h"
#include "smartmill_core/error.h"
#include "smartmill_core/modal/modal_filter.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

/// A cut whose force is known.
struct ReproducedCut {
  std::vector<double> force, measured;  // [N]
};

using Complex = std::complex<double>;

/// Harmonics of a signal, revolution by revolution.
class Revolutions {
 public:
  /// @param angle [rad] per sample
  Revolutions(const std::vector<double>& signal, double angle)
      : angle_(angle),
        length_(units::TWO_PI / angle),
        count_(static_cast<std::size_t>(static_cast<double>(signal.size()) / length_)),
        signal_(signal) {}

  double length() const { return length_; }  ///< [samples]
  std::size_t count() const { return count_; }
  Complex turn(std::size_t n, std::size_t i) const {
    return std::polar(1.0, angle_ * static_cast<double>(n) * static_cast<double>(i));
  }
  /// Harmonic n of each revolution, 0 the constant.
  std::vector<Complex> harmonic(std::size_t n) const {
    std::vector<Complex> amplitudes;
    for (std::size_t k = 0; k < count_; ++k) {
      const std::size_t begin = beginOf(k), end = beginOf(k + 1);
      Complex sum = 0.0;
      for (std::size_t i = begin; i < end; ++i) sum += signal_[i] * std::conj(turn(n, i));
      amplitudes.push_back((n > 0 ? 2.0 : 1.0) * sum / static_cast<double>(end - begin));
    }
    return amplitudes;
  }

 private:
  std::size_t beginOf(std::size_t k) const {
    return static_cast<std::size_t>(std::lround(static_cast<double>(k) * length_));
  }

  double angle_, length_;
  std::size_t count_;
  const std::vector<double>& signal_;
};

class AxisTuner {
 public:
  AxisTuner(const TuningRecord& record, std::size_t axis, const SensorAxis& sensor,
            const HarmonicFilterParameters& parameters, const TuningOptions& options)
      : record_(record), axis_(axis), sensor_(sensor), parameters_(parameters), options_(options) {
    parameters_.noise_rms = sensor.noise_rms;
  }

  TunedMemory tune() const {
    const ReproducedCut cut = reproduce();
    TunedMemory tuned;
    tuned.speed = record_.speed;
    tuned.error = tuned.fixed_error = error(cut, parameters_);
    if (correlation() > options_.max_correlation) return tuned;
    const double highest = (1.0 - options_.least_gain) * tuned.fixed_error;
    for (const double memory : options_.memories) {
      const double candidate = error(cut, uniform(memory));
      if (!(candidate < std::min(tuned.error, highest))) continue;
      tuned.memory = memory;
      tuned.error = candidate;
    }
    return tuned;
  }

 private:
  HarmonicFilterParameters uniform(double memory) const {
    HarmonicFilterParameters parameters = parameters_;
    parameters.uniform_noise = true;
    parameters.memory_revolutions = memory;
    return parameters;
  }

  HarmonicFilter filterOf(const HarmonicFilterParameters& parameters) const {
    return {sensor_.model, record_.speed, record_.sample_rate, parameters};
  }

  ReproducedCut reproduce() const {
    const std::vector<double>& air = record_.air[axis_];
    ReproducedCut cut;
    cut.force = forceOf(record_.cut[axis_]);
    ModalFilter plant(sensor_.model, record_.sample_rate, Hold::first_order);
    for (std::size_t i = 0; i < cut.force.size(); ++i)
      cut.measured.push_back(plant.step(cut.force[i]) + air[i % air.size()]);
    return cut;
  }

  /// Mean weight of each harmonic in the second half of the cut, which is steady.
  std::vector<double> weightsIn(const std::vector<double>& measured) const {
    HarmonicFilter filter = filterOf(parameters_);
    filter.setWeighting(true);
    std::vector<double> weights(static_cast<std::size_t>(filter.pairs().harmonics()) + 1, 0.0);
    double count = 0.0;
    for (std::size_t i = 0; i < measured.size(); ++i) {
      filter.step(measured[i]);
      if (2 * i < measured.size()) continue;
      for (std::size_t n = 0; n < weights.size(); ++n) weights[n] += filter.weight(n);
      ++count;
    }
    for (double& weight : weights) weight /= count;
    return weights;
  }

  /// Smoothed force; where it is steady, the mean revolution without its noise, times the share of it that
  /// each revolution has (0 before tool entry).
  std::vector<double> forceOf(const std::vector<double>& measured) const {
    const std::vector<double> smoothed = filterOf(uniform(options_.reference_memory)).smooth(measured),
                              weights = weightsIn(measured);
    const Revolutions revolutions(smoothed, record_.speed / record_.sample_rate);
    const std::size_t count = revolutions.count(), steady = count - count / 2;
    std::vector<Complex> steady_revolution;
    std::vector<double> share(count, 0.0);
    double power = 0.0;
    for (std::size_t n = 0; n < weights.size(); ++n) {
      const std::vector<Complex> amplitudes = revolutions.harmonic(n);
      Complex sum = 0.0;
      for (std::size_t k = count - steady; k < count; ++k) sum += amplitudes[k];
      steady_revolution.push_back(weights[n] * sum / static_cast<double>(steady));
      power += std::norm(steady_revolution[n]);
      for (std::size_t k = 0; k < count; ++k)
        share[k] += (amplitudes[k] * std::conj(steady_revolution[n])).real();
    }
    std::vector<double> force;
    for (std::size_t i = 0; i < measured.size(); ++i) {
      const std::size_t k =
          std::min(static_cast<std::size_t>(static_cast<double>(i) / revolutions.length()), count - 1);
      const double before = share[k > 0 ? k - 1 : k], after = share[std::min(k + 1, count - 1)];
      if (std::abs(after - before) > options_.changing * power) {
        force.push_back(smoothed[i]);
        continue;
      }
      Complex sum = 0.0;
      for (std::size_t n = 0; n < steady_revolution.size(); ++n)
        sum += steady_revolution[n] * revolutions.turn(n, i);
      force.push_back(power > 0.0 ? sum.real() * share[k] / power : 0.0);
    }
    return force;
  }

  double error(const ReproducedCut& cut, const HarmonicFilterParameters& parameters) const {
    HarmonicFilter filter = filterOf(parameters);
    double squares = 0.0;
    for (std::size_t i = 0; i < cut.force.size(); ++i)
      squares += std::pow(filter.step(cut.measured[i]) - cut.force[i], 2);
    return std::sqrt(squares / static_cast<double>(cut.force.size()));
  }

  /// Lag-one correlation of the fixed design's normalised innovations in the measured cut.
  double correlation() const {
    HarmonicFilter filter = filterOf(parameters_);
    double squares = 0.0, products = 0.0, last = 0.0, time = 0.0;
    for (const double sample : record_.cut[axis_]) {
      filter.step(sample);
      const double innovation = filter.innovation() / filter.innovationStd();
      if ((time += 1.0 / record_.sample_rate) < options_.settled) continue;
      squares += innovation * innovation;
      products += innovation * last;
      last = innovation;
    }
    return squares > 0.0 ? std::abs(products / squares) : 0.0;
  }

  const TuningRecord& record_;
  std::size_t axis_;
  const SensorAxis& sensor_;
  HarmonicFilterParameters parameters_;
  const TuningOptions& options_;
};

void check(const TuningRecord& record, std::size_t axis) {
  const std::size_t revolution =
      static_cast<std::size_t>(units::TWO_PI / record.speed * record.sample_rate) + 1;
  for (const auto* samples : {&record.air[axis], &record.cut[axis]}) {
    if (samples->size() < revolution)
      throw Error(std::string("tuning: ") + AXIS_NAMES[axis] + ": record of " +
                  std::to_string(samples->size()) + " samples, expected a revolution in air and in the cut");
    for (const double sample : *samples) {
      if (!std::isfinite(sample))
        throw Error(std::string("tuning: ") + AXIS_NAMES[axis] + ": a sample is not finite");
    }
  }
}

}  // namespace

std::array<TunedMemory, 3> tuneMemory(const TuningRecord& record, const std::array<SensorAxis, 3>& sensor,
                                      const HarmonicFilterParameters& parameters,
                                      const TuningOptions& options) {
  std::array<TunedMemory, 3> tuned;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    check(record, axis);
    tuned[axis] = AxisTuner(record, axis, sensor[axis], parameters, options).tune();
  }
  return tuned;
}

}  // namespace smartmill::kalman
