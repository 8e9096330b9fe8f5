#include "smartmill_panel/digest/force_spectrum.h"

#include <algorithm>
#include <cmath>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/units.h"

namespace smartmill::panel {

SpectrumMaker::SpectrumMaker(const SpectrumParameters& parameters) : parameters_(parameters) {
  checkBounds(parameters_);
  const auto n = static_cast<std::size_t>(parameters_.samples);
  double sum = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    window_.push_back(0.5 - 0.5 * std::cos(units::TWO_PI * static_cast<double>(i) / static_cast<double>(n)));
    sum += window_.back();
  }
  for (double& w : window_) w *= 2.0 / sum;  // one-sided amplitude
  for (auto& axis : ring_) axis.assign(n, 0.0);
}

void SpectrumMaker::push(const ForceBlock& block) {
  if (block.first_index != expected_ || block.sample_rate != rate_) available_ = 0;
  rate_ = block.sample_rate;
  const std::size_t size = block.force[0].size(), n = window_.size();
  expected_ = block.first_index + size;
  if (size == 0) return;
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t a = 0; a < 3; ++a)
      ring_[a][next_] = std::isnan(block.force[a][i]) ? 0.0 : block.force[a][i];
    next_ = (next_ + 1) % n;
  }
  available_ = std::min(available_ + size, n);
  stamp_ = block.stamp + static_cast<double>(size - 1) / rate_;
  has_new_samples_ = true;
}

std::optional<ForceSpectrum> SpectrumMaker::take() {
  const std::size_t n = window_.size();
  if (!has_new_samples_ || available_ < n) return {};
  has_new_samples_ = false;
  ForceSpectrum result;
  result.stamp = stamp_;
  result.resolution = rate_ / static_cast<double>(n);
  const double highest = std::min(parameters_.highest, 0.5 * rate_);
  const auto used = std::min(static_cast<std::size_t>(highest / result.resolution) + 1, n / 2 + 1);
  const auto lines = static_cast<std::size_t>(parameters_.lines);
  const std::size_t joined = (used + lines - 1) / lines;
  result.step = static_cast<double>(joined) * result.resolution;
  std::vector<double> signal(n);
  for (std::size_t a = 0; a < 3; ++a) {
    double mean = 0.0;
    for (const double x : ring_[a]) mean += x / static_cast<double>(n);
    for (std::size_t i = 0; i < n; ++i) signal[i] = (ring_[a][(next_ + i) % n] - mean) * window_[i];
    const auto transformed = fourier(signal);
    for (std::size_t k = 0; k < used; k += joined) {
      double largest = 0.0;
      for (std::size_t j = k; j < std::min(k + joined, used); ++j)
        largest = std::max(largest, std::abs(transformed[j]));
      result.amplitude[a].push_back(static_cast<float>(largest));
    }
  }
  return result;
}

}  // namespace smartmill::panel
