#include "smartmill_hammer/impact_analysis.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill {
namespace hammer {
namespace {

/// Equal readings in a row at the top of a noisy signal that mean clipping.
constexpr std::size_t CLIPPED_RUN = 3;
/// Lines on each side over which the scatter's variance is averaged: a few hits alone give a variance that is
/// itself scattered, and lines that happen to agree would get far too much weight in a fit.
constexpr std::size_t SMOOTH_LINES = 8;
/// Samples before the hit that give a baseline and a noise worth having.
constexpr std::size_t LEAST_QUIET = 48;

std::string text(const char* format, double a, double b) {
  char line[160];
  std::snprintf(line, sizeof line, format, a, b);
  return line;
}

std::size_t runAtMaximum(const std::vector<double>& values) {
  const double top = *std::max_element(values.begin(), values.end());
  std::size_t longest = 0, run = 0;
  for (const double v : values) {
    run = v == top ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return longest;
}

std::vector<double> part(const std::vector<double>& values, std::size_t from, std::size_t to) {
  return {values.begin() + static_cast<std::ptrdiff_t>(from),
          values.begin() + static_cast<std::ptrdiff_t>(to)};
}

}  // namespace

HitFault hitFault(const Hit& hit, const HitLimits& limits) {
  if (hit.force.empty() || hit.force.size() != hit.response.size()) {
    return {"the record is empty or its channels differ in length", true};
  }
  const std::size_t bad = std::min(firstNotFinite(hit.force), firstNotFinite(hit.response));
  if (bad < hit.force.size()) {
    return {"sample " + std::to_string(bad) + " is not a number", true};
  }
  const double peak = *std::max_element(hit.force.begin(), hit.force.end());
  if (peak < limits.weak_force) {
    return {text("weak hit: peak %.1f N, %.1f N are due", peak, limits.weak_force), false};
  }
  if (runAtMaximum(hit.force) >= CLIPPED_RUN)
    return {text("the force is clipped at %.1f N", peak, 0.0), true};
  if (limits.response_range > 0.0) {
    for (const double v : hit.response) {
      if (std::abs(v) >= limits.response_range) {
        return {text("the response is clipped: %.3f reaches the range %.3f", v, limits.response_range), true};
      }
    }
  }
  std::vector<double> force = hit.force;
  if (hit.pre_trigger >= LEAST_QUIET) {
    const double base = mean(part(force, 0, hit.pre_trigger));
    for (double& f : force) f -= base;
  }
  if (hasSecondHit(force, limits.second_hit_share)) {
    return {text("double hit: beside the main peak of %.1f N another one above %.1f N", peak,
                 limits.second_hit_share * peak),
            false};
  }
  return {};
}

double offsetFactor(double stickout, double offset) {
  if (!(offset >= 0.0 && offset < stickout)) {
    throw Error(text("offset correction: the hammer's offset %.2f mm must lie in 0..stickout (%.2f mm)",
                     1e3 * offset, 1e3 * stickout));
  }
  const double l = stickout - offset;
  return 2.0 * stickout * stickout * stickout / (l * l * (3.0 * stickout - l));
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
                " samples at " + std::to_string(hit.sample_rate) + " Hz, the first hit has " +
                std::to_string(samples_) + " at " + std::to_string(sample_rate_) + " Hz");
  }
  std::vector<double> force = hit.force, response = hit.response;
  double force_noise = 0.0, response_noise = 0.0;
  // The last quarter before the trigger may hold the foot of the hit. A record that begins with the hit shows
  // its noise at its end, and has no baseline.
  const std::size_t quiet_samples = hit.pre_trigger - hit.pre_trigger / 4;
  if (quiet_samples >= LEAST_QUIET) {
    const std::vector<double> quiet_force = part(force, 0, quiet_samples);
    const std::vector<double> quiet = part(response, 0, quiet_samples);
    const double force_base = mean(quiet_force), base = mean(quiet);
    force_noise = standardDeviation(quiet_force);
    response_noise = std::abs(options_.response_scale) * standardDeviation(quiet);
    for (double& f : force) f -= force_base;
    for (double& r : response) r -= base;
    if (options_.sensor_gain > 0.0) {
      for (double& r : response) r /= 1.0 + r / (options_.sensor_gain + base);
    }
  } else if (samples_ >= 10 * LEAST_QUIET) {
    force_noise = standardDeviation(part(force, samples_ - samples_ / 10, samples_));
    response_noise = std::abs(options_.response_scale) *
                     standardDeviation(part(response, samples_ - samples_ / 10, samples_));
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
    // The same decay on both leaves H of the system with its poles moved by 1 / time.
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

FrequencyResponse ImpactAnalysis::frf() const {
  if (!estimator_) throw Error("no hit was recorded");
  FrequencyResponse h = estimator_->h1(options_.unit);
  const std::size_t lines = h.size();
  // Eq. 4.39 (4.29 for one hit) with the noise seen before the hits.
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
    const double floor = n / force_power_[k] * (response_noise + std::norm(h.value[k]) * share * force_noise);
    double variance = 0.0;
    const std::size_t first = k > SMOOTH_LINES ? k - SMOOTH_LINES : 0;
    const std::size_t last = std::min(lines - 1, k + SMOOTH_LINES);
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

}  // namespace hammer
}  // namespace smartmill
