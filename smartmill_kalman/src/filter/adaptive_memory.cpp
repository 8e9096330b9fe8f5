#include "smartmill_kalman/filter/adaptive_memory.h"

#include <algorithm>
#include <cmath>

namespace smartmill::kalman {
namespace {

/// A window whose mean square exceeds the largest of the revolution before by this is a change of the force.
constexpr double OUT_OF_LINE = 5.0;
/// Windows after a start that give the reference power.
constexpr std::size_t LEAST_WINDOWS = 12;
/// Revolutions at a level before the next is tried.
constexpr std::size_t DWELL = 2;
/// A revolution with a mean square below this share of the previous one has not settled.
constexpr double STILL_FALLING = 0.8;
/// Largest mean square at a longer memory, relative to that at the shortest.
constexpr double MEMORY_TOO_LONG = 1.5;

}  // namespace

AdaptiveMemory::AdaptiveMemory(std::size_t levels, double revolution) : levels_(levels) {
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
  const bool known = level_ > 0 || windows_ >= LEAST_WINDOWS || last_peak_ > 0.0;
  if (known && mean > OUT_OF_LINE * (level_ > 0 ? last_peak_ : std::max(last_peak_, peak_))) {
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
  const bool settled = mean > STILL_FALLING * last_mean_;
  if (level_ > 0 && mean > MEMORY_TOO_LONG * accepted_mean_) {
    --level_;
    dwell_ = 0;
  } else if (++dwell_ > DWELL && settled && level_ + 1 < levels_) {
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
