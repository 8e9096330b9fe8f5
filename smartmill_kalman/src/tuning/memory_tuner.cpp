#include "smartmill_kalman/tuning/memory_tuner.h"

#include <algorithm>
#include <cmath>

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
    cut.force = filterOf(uniform(options_.reference_memory)).smooth(record_.cut[axis_]);
    ModalFilter plant(sensor_.model, record_.sample_rate, Hold::first_order);
    for (std::size_t i = 0; i < cut.force.size(); ++i)
      cut.measured.push_back(plant.step(cut.force[i]) + air[i % air.size()]);
    return cut;
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
