#include "smartmill_panel/digest/force_strip.h"

#include <cmath>
#include <limits>

namespace smartmill::panel {

StripMaker::StripMaker(const StripParameters& parameters, Handler handler)
    : parameters_(parameters), handler_(std::move(handler)) {
  checkBounds(parameters_);
  strip_.bin = parameters_.bin;
}

void StripMaker::open() {
  low_.fill(std::numeric_limits<float>::quiet_NaN());
  high_ = low_;
}

// Bins without samples are NaN; a long interval without samples starts a new message.
void StripMaker::begin(std::int64_t bin) {
  const std::int64_t most = parameters_.bins;
  if (any_) {
    strip_.low.insert(strip_.low.end(), low_.begin(), low_.end());
    strip_.high.insert(strip_.high.end(), high_.begin(), high_.end());
    const auto held = static_cast<std::int64_t>(strip_.low.size() / 3);
    if (held >= most || bin < bin_ || bin > bin_ + most) {
      handler_(strip_);
      strip_.low.clear();
      strip_.high.clear();
    } else {
      const auto silent = static_cast<std::size_t>(bin - bin_ - 1);
      strip_.low.insert(strip_.low.end(), 3 * silent, std::numeric_limits<float>::quiet_NaN());
      strip_.high.resize(strip_.low.size(), std::numeric_limits<float>::quiet_NaN());
    }
  }
  if (strip_.low.empty()) strip_.stamp = static_cast<double>(bin) * parameters_.bin;
  bin_ = bin;
  any_ = true;
  open();
}

void StripMaker::push(const ForceBlock& block) {
  const std::size_t size = block.force[0].size();
  for (std::size_t i = 0; i < size; ++i) {
    // A sample on an edge belongs to the later bin despite rounding of the stamp.
    constexpr double EDGE = 1e-6;
    const double time = block.stamp + static_cast<double>(i) / block.sample_rate;
    const auto bin = static_cast<std::int64_t>(std::floor(time / parameters_.bin + EDGE));
    if (!any_ || bin != bin_) begin(bin);
    for (std::size_t a = 0; a < 3; ++a) {
      const auto value = static_cast<float>(block.force[a][i]);
      if (!(value >= low_[a])) low_[a] = std::isnan(value) ? low_[a] : value;
      if (!(value <= high_[a])) high_[a] = std::isnan(value) ? high_[a] : value;
    }
  }
}

void StripMaker::flush() {
  if (!any_) return;
  strip_.low.insert(strip_.low.end(), low_.begin(), low_.end());
  strip_.high.insert(strip_.high.end(), high_.begin(), high_.end());
  handler_(strip_);
  strip_.low.clear();
  strip_.high.clear();
  any_ = false;
}

}  // namespace smartmill::panel
