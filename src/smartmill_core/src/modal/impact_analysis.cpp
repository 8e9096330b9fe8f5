#include "smartmill_core/modal/impact_analysis.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <iterator>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace {

std::vector<double> part(const std::vector<double>& values, std::size_t from, std::size_t to) {
  return {values.begin() + static_cast<std::ptrdiff_t>(from),
          values.begin() + static_cast<std::ptrdiff_t>(to)};
}

/// [1/sample] by the central difference of order eight.
double slopeAt(const std::vector<double>& values, std::size_t i) {
  constexpr double WEIGHTS[] = {4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0};
  double slope = 0.0;
  for (std::size_t k = 1; k <= std::size(WEIGHTS); ++k)
    if (i >= k && i + k < values.size()) slope += WEIGHTS[k - 1] * (values[i + k] - values[i - k]);
  return slope;
}

/// Linearises a sensor's voltage v = x G / (G - x). A mean over a time in which x moves linearly by d
/// contains v'' / 2 times the variance d^2 / 12, with v'' / v' = 2 / (G - x).
void straighten(std::vector<double>& response, double gain, double averaged_share) {
  for (double& r : response) r /= 1.0 + r / gain;
  if (averaged_share <= 0.0) return;
  const std::vector<double> mean = response;
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const double run = averaged_share * slopeAt(mean, i);
    response[i] -= run * run / 12.0 / (gain - mean[i]);
  }
}

}  // namespace

double noiseUnderRinging(const std::vector<double>& values) {
  constexpr double BINOMIAL[] = {1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0};
  constexpr double SQUARES = 924.0;  // sum of the squared coefficients
  constexpr std::size_t TAPS = 7;
  const double scatter = standardDeviation(values);
  if (values.size() < 4 * TAPS) return scatter;
  double sum = 0.0;
  for (std::size_t i = 0; i + TAPS <= values.size(); ++i) {
    double difference = 0.0;
    for (std::size_t k = 0; k < TAPS; ++k) difference += BINOMIAL[k] * values[i + k];
    sum += difference * difference;
  }
  return std::min(scatter, std::sqrt(sum / SQUARES / static_cast<double>(values.size() - TAPS + 1)));
}

ImpactAnalysis::ImpactAnalysis(const ImpactOptions& options) : options_(options) {
}

void ImpactAnalysis::add(const Hit& hit) {
  if (!estimator_) {
    sample_rate_ = hit.sample_rate;
    samples_ = hit.force.size();
    estimator_.emplace(sample_rate_, samples_);
    force_power_.assign(samples_ / 2 + 1, 0.0);
  }
  if (hit.sample_rate != sample_rate_ || hit.force.size() != samples_) {
    throw Error("hit " + std::to_string(hits_ + 1) + ": " + std::to_string(hit.force.size()) +
                " samples at " + std::to_string(hit.sample_rate) + " Hz, expected those of the first hit: " +
                std::to_string(samples_) + " at " + std::to_string(sample_rate_) + " Hz");
  }
  std::vector<double> force = hit.force, response = hit.response;
  double force_noise = 0.0, response_noise = 0.0;
  // The last quarter before the trigger may contain the onset of the hit. A record that begins with the hit
  // has its noise at the end, and no baseline.
  const std::size_t quiet_samples = hit.pre_trigger - hit.pre_trigger / 4;
  if (quiet_samples >= LEAST_QUIET_SAMPLES) {
    const std::vector<double> quiet_force = part(force, 0, quiet_samples);
    const std::vector<double> quiet = part(response, 0, quiet_samples);
    const double force_base = mean(quiet_force), base = mean(quiet);
    force_noise = standardDeviation(quiet_force);
    response_noise = std::abs(options_.response_scale) * standardDeviation(quiet);
    for (double& f : force) f -= force_base;
    for (double& r : response) r -= base;
    if (options_.sensor_gain > 0.0)
      straighten(response, options_.sensor_gain + base, options_.averaged_share);
  } else if (samples_ >= 10 * LEAST_QUIET_SAMPLES) {
    force_noise = noiseUnderRinging(part(force, samples_ - samples_ / 10, samples_));
    response_noise = std::abs(options_.response_scale) *
                     noiseUnderRinging(part(response, samples_ - samples_ / 10, samples_));
  }
  double share = 1.0;
  if (options_.window_force) {
    const std::vector<double> window = impactWindow(force);
    share = 0.0;
    for (std::size_t i = 0; i < force.size(); ++i) {
      force[i] *= window[i];
      share += window[i] * window[i] / static_cast<double>(force.size());
    }
  }
  for (double& r : response) r *= options_.response_scale;
  if (options_.exponential_time > 0.0) {
    // The same decay on both channels gives H of the system with its poles shifted by 1 / time.
    for (std::size_t i = 0; i < force.size(); ++i) {
      const double t = (static_cast<double>(i) - static_cast<double>(hit.pre_trigger)) / sample_rate_;
      const double decay = t > 0.0 ? std::exp(-t / options_.exponential_time) : 1.0;
      force[i] *= decay;
      response[i] *= decay;
    }
  }
  estimator_->add(force, response);
  const auto spectrum = fourier(force);
  for (std::size_t k = 0; k < spectrum.size(); ++k) force_power_[k] += std::norm(spectrum[k]);
  force_noise_ += force_noise * force_noise;
  response_noise_ += response_noise * response_noise;
  window_share_ += share;
  ++hits_;
}

FrequencyResponse ImpactAnalysis::frf(FrfAverage average) const {
  if (!estimator_) throw Error("no hit was recorded");
  FrequencyResponse h =
      average == FrfAverage::h2 ? estimator_->h2(options_.unit) : estimator_->h1(options_.unit);
  for (std::size_t k = 0; average == FrfAverage::hv && k < h.size(); ++k) {
    // |H2| = |H1| / C
    if (h.coherence[k] > 0.0) h.value[k] /= std::sqrt(h.coherence[k]);
  }
  const std::size_t lines = h.size();
  // Eq. 4.39 for H1, 4.41 for H2 (with S_xx = S_ff |H1| |H2|), between them for Hv; with the noise before the
  // hits. One hit: eq. 4.29.
  const double n = static_cast<double>(samples_), m = static_cast<double>(hits_);
  const double share = window_share_ / m, force_noise = force_noise_ / m,
               response_noise = response_noise_ / m;
  std::vector<double> scatter(lines, 0.0);
  if (hits_ > 1) {
    for (std::size_t k = 0; k < lines; ++k) {
      if (std::isfinite(h.std_dev[k])) scatter[k] = h.std_dev[k] * h.std_dev[k];
    }
  }
  for (std::size_t k = 0; k < lines; ++k) {
    const double c = h.coherence[k] > 0.0 ? h.coherence[k] : 1.0;
    const double of_response = response_noise, of_force = std::norm(h.value[k]) * share * force_noise;
    double floor = n / force_power_[k];
    if (average == FrfAverage::h1) {
      floor *= of_response + of_force / c;
    } else if (average == FrfAverage::h2) {
      floor *= (of_response / c + of_force) / c;
    } else {
      floor *= (of_response + of_force) / c;
    }
    double variance = 0.0;
    const std::size_t first = k > options_.smooth_lines ? k - options_.smooth_lines : 0;
    const std::size_t last = std::min(lines - 1, k + options_.smooth_lines);
    for (std::size_t j = first; j <= last; ++j)
      variance += scatter[j] / static_cast<double>(last - first + 1);
    variance = std::max(variance, floor);
    h.std_dev[k] = variance > 0.0 ? std::sqrt(variance) : std::numeric_limits<double>::quiet_NaN();
  }
  return h;
}

void ImpactAnalysis::removeWindowDamping(ModalModel& model) const {
  if (options_.exponential_time <= 0.0) return;
  for (Mode& mode : model.modes) {
    mode.damping_ratio -= 1.0 / (options_.exponential_time * units::TWO_PI * mode.frequency);
  }
}

}  // namespace smartmill
