#include "smartmill_core/signal/frequency_response.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartmill_core/error.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/statistics.h"
#include "smartmill_core/units.h"

namespace smartmill {

FrequencyResponse FrequencyResponse::band(double low, double high) const {
  FrequencyResponse part;
  part.unit = unit;
  part.averages = averages;
  for (std::size_t i = 0; i < size(); ++i) {
    if (frequency[i] < low || frequency[i] > high) {
      continue;
    }
    part.frequency.push_back(frequency[i]);
    part.value.push_back(value[i]);
    if (!coherence.empty()) {
      part.coherence.push_back(coherence[i]);
    }
    if (!std_dev.empty()) {
      part.std_dev.push_back(std_dev[i]);
    }
  }
  return part;
}

std::complex<double> FrequencyResponse::at(double f) const {
  if (frequency.empty() || !(f >= frequency.front() && f <= frequency.back())) {
    throw Error("frequency response: " + std::to_string(f) + " Hz is outside its lines" +
                (frequency.empty() ? std::string(" (none)")
                                   : " " + std::to_string(frequency.front()) + ".." +
                                         std::to_string(frequency.back()) + " Hz"));
  }
  const auto above = std::lower_bound(frequency.begin(), frequency.end(), f);
  const auto i = static_cast<std::size_t>(above - frequency.begin());
  if (frequency[i] == f) {
    return value[i];
  }
  const double share = (f - frequency[i - 1]) / (frequency[i] - frequency[i - 1]);
  return value[i - 1] + share * (value[i] - value[i - 1]);
}

FrfEstimator::FrfEstimator(double sample_rate, std::size_t samples)
    : sample_rate_(sample_rate),
      samples_(samples),
      sff_(samples / 2 + 1, 0.0),
      sxx_(samples / 2 + 1, 0.0),
      sfx_(samples / 2 + 1, 0.0) {
  if (!(sample_rate > 0.0) || samples < 2) {
    throw Error("FRF: a hit needs a positive sample rate and two samples, got " +
                std::to_string(sample_rate) + " Hz and " + std::to_string(samples));
  }
}

void FrfEstimator::add(const std::vector<double>& force, const std::vector<double>& response) {
  if (force.size() != samples_ || response.size() != samples_) {
    throw Error("FRF: hit " + std::to_string(hits_ + 1) + " has " + std::to_string(force.size()) + " and " +
                std::to_string(response.size()) + " samples, expected " + std::to_string(samples_));
  }
  const std::size_t bad = std::min(firstNotFinite(force), firstNotFinite(response));
  if (bad < samples_) {
    throw Error("FRF: hit " + std::to_string(hits_ + 1) + ", sample " + std::to_string(bad) +
                " is not a number");
  }
  const auto f = fourier(force);
  const auto x = fourier(response);
  for (std::size_t k = 0; k < f.size(); ++k) {
    sff_[k] += std::norm(f[k]);
    sxx_[k] += std::norm(x[k]);
    sfx_[k] += std::conj(f[k]) * x[k];
  }
  ++hits_;
}

void FrfEstimator::setNoise(double force_rms, double response_rms, double force_window_power_share) {
  force_noise_ = force_rms;
  response_noise_ = response_rms;
  force_window_share_ = force_window_power_share;
  noise_known_ = true;
}

FrequencyResponse FrfEstimator::h1(const std::string& unit) const {
  return result(unit, false);
}

FrequencyResponse FrfEstimator::h2(const std::string& unit) const {
  return result(unit, true);
}

FrequencyResponse FrfEstimator::result(const std::string& unit, bool second) const {
  if (hits_ == 0) {
    throw Error("FRF: no hit was added");
  }
  constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();
  FrequencyResponse frf;
  frf.unit = unit;
  frf.averages = hits_;
  frf.frequency = fourierFrequencies(samples_, sample_rate_);
  const std::size_t lines = frf.frequency.size();
  frf.value.resize(lines);
  frf.coherence.assign(lines, UNKNOWN);
  frf.std_dev.assign(lines, UNKNOWN);
  for (std::size_t k = 0; k < lines; ++k) {
    if (sff_[k] == 0.0) {
      throw Error("FRF: the force has no power at " + std::to_string(frf.frequency[k]) + " Hz");
    }
    const double cross = std::norm(sfx_[k]);
    if (second && cross > 0.0) {
      frf.value[k] = sxx_[k] / std::conj(sfx_[k]);
    } else {
      frf.value[k] = sfx_[k] / sff_[k];
    }
    const double power = std::norm(frf.value[k]);
    if (hits_ > 1) {
      const double coherence = cross > 0.0 ? std::min(1.0, cross / (sxx_[k] * sff_[k])) : 0.0;
      frf.coherence[k] = coherence;
      if (coherence > 0.0) {
        frf.std_dev[k] = std::sqrt(power * (1.0 - coherence) / (coherence * (hits_ - 1)));
      }
    } else if (noise_known_) {
      // Eq. 4.29; the window passes only its power share of the force's noise (eq. 4.15).
      const double n = static_cast<double>(samples_);
      frf.std_dev[k] = std::sqrt(
          n / sff_[k] *
          (response_noise_ * response_noise_ + power * force_window_share_ * force_noise_ * force_noise_));
    }
  }
  return frf;
}

FrequencyResponse receptanceFromAccelerance(const FrequencyResponse& accelerance) {
  FrequencyResponse receptance =
      accelerance.band(std::numeric_limits<double>::min(), std::numeric_limits<double>::infinity());
  receptance.unit = "m/N";
  for (std::size_t i = 0; i < receptance.size(); ++i) {
    const double square = std::pow(units::TWO_PI * receptance.frequency[i], 2);
    receptance.value[i] /= -square;
    if (!receptance.std_dev.empty()) {
      receptance.std_dev[i] /= square;
    }
  }
  return receptance;
}

}  // namespace smartmill
