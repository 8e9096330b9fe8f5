#include "smartmill_stability/chatter/sound_features.h"

#include <algorithm>
#include <cmath>

#include "chatter/cut_finder.h"
#include "smartmill_core/signal/fourier.h"
#include "smartmill_core/signal/window.h"

namespace smartmill::stability {
namespace {

/// Lines from a frequency [Hz] to another.
struct Band {
  std::size_t from, to;
};
Band bandOf(double low, double high, double step, std::size_t lines) {
  const auto from = static_cast<std::size_t>(std::ceil(low / step - 1e-6));
  const auto to = static_cast<std::size_t>(std::floor(high / step + 1e-6)) + 1;
  return {std::min(from, lines), std::min(to, lines)};
}

}  // namespace

void SoundFrames::reset(double sample_rate) {
  const auto n = static_cast<std::size_t>(std::lround(SECONDS * sample_rate));
  taper_ = hannWindow(n);
  double square = 0.0;
  for (const double w : taper_) square += w * w;
  scale_ = 2.0 / (static_cast<double>(n) * square);  // one-sided mean square
  step_ = sample_rate / static_cast<double>(n);
  samples_.clear();
  clipped_ = 0;
}

bool SoundFrames::push(double time, double value, bool clipped) {
  if (samples_.empty()) begin_ = time;
  samples_.push_back(value);
  clipped_ += clipped;
  if (samples_.size() < taper_.size()) return false;
  frame_.begin = begin_;
  frame_.samples = samples_.size();
  frame_.clipped = clipped_;
  for (std::size_t i = 0; i < samples_.size(); ++i) samples_[i] *= taper_[i];
  const auto spectrum = fourier(samples_);
  frame_.power.resize(spectrum.size());
  for (std::size_t k = 0; k < spectrum.size(); ++k) frame_.power[k] = scale_ * std::norm(spectrum[k]);
  const auto sum = [&](double low, double high) {
    const Band band = bandOf(low, high, step_, frame_.power.size());
    double all = 0.0;
    for (std::size_t k = band.from; k < band.to; ++k) all += frame_.power[k];
    return all;
  };
  const CutFinderOptions detection;
  frame_.loudness = sum(detection.lowest, detection.highest);
  frame_.total = sum(LOWEST, HIGHEST);
  samples_.clear();
  clipped_ = 0;
  return true;
}

bool FeatureMaker::push(const SoundFrame& frame, double step) {
  if (count_ == 0) {
    power_.assign(frame.power.size(), 0.0);
    begin_ = frame.begin;
    clipped_ = samples_ = 0;
  }
  for (std::size_t k = 0; k < power_.size(); ++k) power_[k] += frame.power[k] / FRAMES;
  clipped_ += frame.clipped;
  samples_ += frame.samples;
  if (++count_ < FRAMES) return false;
  count_ = 0;
  const Band band = bandOf(SoundFrames::LOWEST, SoundFrames::HIGHEST, step, power_.size());
  features_.stamp = begin_;
  features_.duration = static_cast<double>(FRAMES) / step;
  features_.clipped = static_cast<double>(clipped_) / static_cast<double>(samples_);
  features_.lowest = step * static_cast<double>(band.from);
  features_.step = step;
  features_.amplitude.clear();
  double total = 0.0;
  for (std::size_t k = band.from; k < band.to; ++k) {
    total += power_[k];
    features_.amplitude.push_back(static_cast<float>(std::sqrt(power_[k])));
  }
  features_.level = std::sqrt(total);
  return true;
}

}  // namespace smartmill::stability
