#include "smartmill_kalman/filter/inverse_filter.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

void require(bool good, const char* key, double value, const char* expected) {
  if (!good || !std::isfinite(value))
    throw Error(std::string(key) + ": " + std::to_string(value) + ", expected " + expected);
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
    : latency_(parameters.latency) {
  parameters.validate();
  const std::size_t n = 2 * parameters.taps;
  const std::vector<double> frequency = fourierFrequencies(n, sample_rate);
  std::vector<std::complex<double>> inverse;
  for (const double f : frequency) {
    const std::complex<double> h = sensor.response(f);
    const double beyond = std::clamp((f - parameters.bandwidth) / parameters.transition, 0.0, 1.0);
    const double weight = 0.5 * (1.0 + std::cos(units::PI * beyond));
    const double floor = parameters.uncertainty * parameters.uncertainty + parameters.noise_share;
    inverse.push_back(weight * std::conj(h) / (std::norm(h) + floor) *
                      std::polar(1.0, -units::TWO_PI * f / sample_rate * static_cast<double>(latency_)));
  }
  taps_ = inverseFourier(inverse, n);
  // The end of the impulse response is tapered.
  taps_.resize(parameters.taps);
  const std::size_t tail = parameters.taps / 8;
  for (std::size_t i = 0; i < tail; ++i) {
    taps_[parameters.taps - 1 - i] *=
        0.5 * (1.0 - std::cos(units::PI * static_cast<double>(i) / static_cast<double>(tail)));
  }
  reset();
}

void InverseFilter::reset() {
  history_.assign(taps_.size() - 1, 0.0);
}

std::vector<double> InverseFilter::process(const std::vector<double>& samples) {
  if (samples.empty()) return {};
  std::vector<double> joined = history_;
  joined.insert(joined.end(), samples.begin(), samples.end());
  std::size_t length = 1;
  while (length < joined.size()) length *= 2;
  history_.assign(joined.end() - static_cast<std::ptrdiff_t>(taps_.size() - 1), joined.end());
  if (length != length_) {
    std::vector<double> padded = taps_;
    padded.resize(length, 0.0);
    spectrum_ = fourier(padded);
    length_ = length;
  }
  joined.resize(length, 0.0);
  auto product = fourier(joined);
  for (std::size_t k = 0; k < product.size(); ++k) product[k] *= spectrum_[k];
  const std::vector<double> circular = inverseFourier(product, length);
  const auto first = circular.begin() + static_cast<std::ptrdiff_t>(taps_.size() - 1);
  return {first, first + static_cast<std::ptrdiff_t>(samples.size())};
}

}  // namespace smartmill::kalman
