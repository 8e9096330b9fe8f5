#include "smartmill_kalman/filter/adaptive_memory.h"

#include <algorithm>
#include <cmath>

namespace smartmill::kalman {
AdaptiveMemory::AdaptiveMemory(std::size_t levels, double revolution, const AdaptiveMemoryOptions& options)
    : options_(options), levels_(levels) {
  setRevolution(revolution);
}

void AdaptiveMemory::setRevolution(double revolution) {
  windows_a_revolution_ = std::max<std::size_t>(
      4, static_cast<std::size_t>(std::lround(revolution / static_cast<double>(WINDOW))));
}

void AdaptiveMemory::reset() {
  level_ = 0;
  window_count_ = windows_ = dwell_ = 0;
  window_sum_ = revolution_sum_ = peak_ = last_peak_ = last_mean_ = accepted_mean_ = 0.0;
}

void AdaptiveMemory::checkWindow() {
  const double mean = window_sum_ / static_cast<double>(WINDOW);
  window_count_ = 0;
  window_sum_ = 0.0;
  const bool known = level_ > 0 || windows_ >= options_.least_windows || last_peak_ > 0.0;
  if (known && mean > options_.out_of_line * (level_ > 0 ? last_peak_ : std::max(last_peak_, peak_))) {
    level_ = 0;
    ++restarts_;
    windows_ = dwell_ = 0;
    revolution_sum_ = last_mean_ = 0.0;
    peak_ = last_peak_ = mean;
    return;
  }
  revolution_sum_ += mean;
  peak_ = std::max(peak_, mean);
  if (++windows_ == windows_a_revolution_) checkRevolution();
}

void AdaptiveMemory::checkRevolution() {
  const double mean = revolution_sum_ / static_cast<double>(windows_);
  const bool settled = mean > options_.still_falling * last_mean_;
  if (level_ > 0 && mean > options_.memory_too_long * accepted_mean_) {
    --level_;
    dwell_ = 0;
  } else if (++dwell_ > options_.dwell && settled && level_ + 1 < levels_) {
    if (level_ == 0) accepted_mean_ = mean;
    ++level_;
    dwell_ = 0;
  }
  last_mean_ = mean;
  last_peak_ = peak_;
  windows_ = 0;
  revolution_sum_ = peak_ = 0.0;
}

}  // namespace smartmill::kalman
