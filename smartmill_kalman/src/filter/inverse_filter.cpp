#include "smartmill_kalman/filter/inverse_filter.h"

#include <cmath>
#include <complex>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"

namespace smartmill::kalman {
namespace {

void require(bool good, const char* key, double value, const char* expected) {
  if (!good || !std::isfinite(value))
    throw Error(std::string(key) + ": " + std::to_string(value) + ", expected " + expected);
}

std::vector<double> inverseTaps(const ModalModel& sensor, double sample_rate,
                                const InverseParameters& parameters) {
  parameters.validate();
  const FirDesign design{sample_rate, 2 * parameters.taps, parameters.taps, parameters.latency};
  const double floor = parameters.uncertainty * parameters.uncertainty + parameters.noise_share;
  std::vector<std::complex<double>> inverse;
  for (const double f : fourierFrequencies(design.samples, sample_rate)) {
    const std::complex<double> h = sensor.response(f);
    const double weight = fadeOut((f - parameters.bandwidth) / parameters.transition);
    inverse.push_back(weight * std::conj(h) / (std::norm(h) + floor) * design.late(f, 1.0));
  }
  return design.tapsOf(inverse);
}

}  // namespace

void InverseParameters::validate() const {
  require(bandwidth > 0.0, "bandwidth", bandwidth, "above 0 Hz");
  require(transition > 0.0, "transition", transition, "above 0 Hz");
  require(noise_share >= 0.0, "noise_share", noise_share, "at least 0");
  require(uncertainty >= 0.0, "uncertainty", uncertainty, "at least 0");
  require(taps > latency, "taps", static_cast<double>(taps), "more than latency");
}

InverseFilter::InverseFilter(const ModalModel& sensor, double sample_rate,
                             const InverseParameters& parameters)
    : latency_(parameters.latency), filter_(1, {inverseTaps(sensor, sample_rate, parameters)}) {
}

}  // namespace smartmill::kalman
