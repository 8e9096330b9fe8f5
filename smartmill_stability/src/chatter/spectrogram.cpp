#include "chatter/spectrogram.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numeric>
#include <utility>

#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"
#include "smartmill_core/units.h"

namespace smartmill::stability {
namespace {

std::vector<double> taper(std::size_t n) {
  std::vector<double> window(n);
  for (std::size_t i = 0; i < n; ++i)
    window[i] = blackmanHarris(units::TWO_PI * static_cast<double>(i) / static_cast<double>(n));
  return window;
}

}  // namespace

Spectrogram spectrogramOf(const Recording& recording, double window_seconds, double highest) {
  const auto length = static_cast<std::size_t>(window_seconds * recording.sample_rate);
  const std::size_t hop = length / 2, samples = recording.channels[0].size();
  const std::vector<double> window = taper(length);
  Spectrogram result;
  const double step = recording.sample_rate / static_cast<double>(length);
  const auto lines = static_cast<std::size_t>(std::min(highest, 0.45 * recording.sample_rate) / step);
  for (std::size_t k = 0; k < lines; ++k) result.frequency.push_back(step * static_cast<double>(k));
  std::vector<double> size;  // mean square of each channel
  for (const std::vector<double>& channel : recording.channels) {
    const double n = static_cast<double>(samples);
    const double mean = std::accumulate(channel.begin(), channel.end(), 0.0) / n;
    double square = 0.0;
    for (const double v : channel) square += (v - mean) * (v - mean) / n;
    size.push_back(square);
  }
  if (recording.same_unit) size.assign(size.size(), *std::max_element(size.begin(), size.end()));
  std::vector<double> piece(length);
  for (std::size_t at = 0; at + length <= samples; at += hop) {
    std::vector<double> power(lines, 0.0);
    for (std::size_t c = 0; c < recording.channels.size(); ++c) {
      if (!(size[c] > 0.0)) continue;
      const double* values = recording.channels[c].data() + at;
      const double mean = std::accumulate(values, values + length, 0.0) / static_cast<double>(length);
      for (std::size_t i = 0; i < length; ++i) piece[i] = (values[i] - mean) * window[i];
      const auto spectrum = fourier(piece);
      const double scale = 1.0 / (size[c] * static_cast<double>(length * length));
      for (std::size_t k = 0; k < lines; ++k) power[k] += scale * std::norm(spectrum[k]);
    }
    result.time.push_back((static_cast<double>(at) + 0.5 * static_cast<double>(length)) /
                          recording.sample_rate);
    result.power.push_back(std::move(power));
  }
  return result;
}

std::vector<double> loudPower(const Spectrogram& spectrogram) {
  std::vector<double> level;
  for (const std::vector<double>& power : spectrogram.power)
    level.push_back(std::accumulate(power.begin(), power.end(), 0.0));
  const double mean = std::accumulate(level.begin(), level.end(), 0.0) / static_cast<double>(level.size());
  std::vector<double> sum(spectrogram.frequency.size(), 0.0);
  for (std::size_t w = 0; w < level.size(); ++w)
    for (std::size_t k = 0; k < sum.size(); ++k)
      if (level[w] >= 0.5 * mean) sum[k] += spectrogram.power[w][k];
  return sum;
}

Recording atHigherRate(const Recording& recording, int factor) {
  Recording result = recording;
  result.sample_rate *= factor;
  for (std::vector<double>& channel : result.channels) {
    const std::size_t n = channel.size(), finer = n * static_cast<std::size_t>(factor);
    std::vector<std::complex<double>> spectrum = fourier(channel);
    if (n % 2 == 0) spectrum.back() *= 0.5;  // shared by both sides
    spectrum.resize(finer / 2 + 1);
    channel = inverseFourier(spectrum, finer);
    for (double& value : channel) value *= factor;
  }
  return result;
}

}  // namespace smartmill::stability
