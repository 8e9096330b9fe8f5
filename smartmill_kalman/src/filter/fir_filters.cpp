#include "smartmill_kalman/filter/fir_filters.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::kalman {
namespace {

using Complex = std::complex<double>;

/// An eighth of the taps is tapered: the inverse of a force sensor has rung out before.
constexpr std::size_t TAPERED = 8;

}  // namespace

double fadeOut(double beyond) {
  return 0.5 * (1.0 + std::cos(units::PI * std::clamp(beyond, 0.0, 1.0)));
}

Complex FirDesign::late(double f, double gain) const {
  return std::polar(gain, -units::TWO_PI * f / sample_rate * static_cast<double>(latency));
}

std::vector<double> FirDesign::tapsOf(const std::vector<Complex>& response) const {
  std::vector<double> result = inverseFourier(response, samples);
  result.resize(taps);
  const std::size_t tail = taps / TAPERED;
  for (std::size_t i = 0; i < tail; ++i)
    result[taps - 1 - i] *=
        0.5 * (1.0 - std::cos(units::PI * static_cast<double>(i) / static_cast<double>(tail)));
  return result;
}

FirFilters::FirFilters(std::size_t inputs, std::vector<std::vector<double>> taps)
    : taps_(std::move(taps)), history_(inputs) {
  reset();
}

void FirFilters::reset() {
  for (std::vector<double>& channel : history_) channel.assign(taps_.front().size() - 1, 0.0);
}

void FirFilters::transformTaps(std::size_t length) {
  if (length == length_) return;
  length_ = length;
  spectra_.clear();
  for (std::vector<double> padded : taps_) {
    padded.resize(length, 0.0);
    spectra_.push_back(fourier(padded));
  }
}

std::vector<std::vector<double>> FirFilters::process(const std::vector<std::vector<double>>& samples) {
  const std::size_t outputs = taps_.size() / inputs();
  const std::size_t count = samples.front().size(), before = history_.front().size();
  if (count == 0) return std::vector<std::vector<double>>(outputs);
  std::size_t length = 1;  // power of two
  while (length < before + count) length *= 2;
  transformTaps(length);
  std::vector<std::vector<Complex>> sum(outputs, std::vector<Complex>(length / 2 + 1));
  for (std::size_t j = 0; j < inputs(); ++j) {
    std::vector<double> joined = history_[j];
    joined.insert(joined.end(), samples[j].begin(), samples[j].end());
    history_[j].assign(joined.end() - static_cast<std::ptrdiff_t>(before), joined.end());
    joined.resize(length, 0.0);
    const std::vector<Complex> spectrum = fourier(joined);
    for (std::size_t i = 0; i < outputs; ++i) {
      const std::vector<Complex>& tap = spectra_[i * inputs() + j];
      for (std::size_t l = 0; l < spectrum.size(); ++l) sum[i][l] += tap[l] * spectrum[l];
    }
  }
  std::vector<std::vector<double>> filtered;
  for (const std::vector<Complex>& spectrum : sum) {
    const std::vector<double> circular = inverseFourier(spectrum, length);
    const auto first = circular.begin() + static_cast<std::ptrdiff_t>(before);
    filtered.emplace_back(first, first + static_cast<std::ptrdiff_t>(count));
  }
  return filtered;
}

}  // namespace smartmill::kalman
