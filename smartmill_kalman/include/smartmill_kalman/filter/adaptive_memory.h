#pragma once

#include <cstddef>

namespace smartmill::kalman {

struct AdaptiveMemoryOptions {
  /// [1] A window whose mean square exceeds the largest of the revolution before by this is a change of the
  /// force; windows of noise do not.
  double out_of_line = 5.0;
  std::size_t least_windows = 12;  ///< after a start, which give the reference power
  std::size_t dwell = 2;           ///< [revolutions] at a level before the next, longer one is tried
  double still_falling = 0.8;    ///< [1] of the mean square of the last revolution: below it has not settled
  double memory_too_long = 1.5;  ///< [1] largest mean square at a longer memory over that at the shortest
};

/// Chooses the memory of a filter from its innovations; level 0 is the shortest. A window of samples with
/// larger innovations than in the revolution before (a change of the force) resets the level. A revolution
/// without a decrease of the innovations raises it.
class AdaptiveMemory {
 public:
  /// @param levels >= 1 @param revolution [samples]
  AdaptiveMemory(std::size_t levels, double revolution, const AdaptiveMemoryOptions& options = {});

  /// @param innovation [N] of one sample
  void add(double innovation) {
    window_sum_ += innovation * innovation;
    if (++window_count_ == WINDOW) checkWindow();
  }
  /// Changes the length of a revolution [samples]; the state is kept.
  void setRevolution(double revolution);
  /// As new; restarts() continues.
  void reset();

  std::size_t level() const { return level_; }
  std::size_t levels() const { return levels_; }
  bool settled() const { return level_ + 1 == levels_; }
  /// Number of resets by large innovations.
  std::size_t restarts() const { return restarts_; }
  void setLevel(std::size_t level) { level_ = level < levels_ ? level : levels_ - 1; }
  void setLevels(std::size_t levels) {
    levels_ = levels;
    setLevel(level_);
  }

  static constexpr std::size_t WINDOW = 16;  ///< [samples]
  /// [samples] between a change of the force and its detection: the window, and the delay of the sensor.
  static constexpr std::size_t DETECTION_DELAY = WINDOW + 8;

 private:
  void checkWindow();
  void checkRevolution();

  AdaptiveMemoryOptions options_;
  std::size_t levels_, level_ = 0, restarts_ = 0;
  std::size_t window_count_ = 0, windows_ = 0, windows_a_revolution_ = 1, dwell_ = 0;
  double window_sum_ = 0.0, revolution_sum_ = 0.0, peak_ = 0.0, last_peak_ = 0.0, last_mean_ = 0.0,
         accepted_mean_ = 0.0;
};

}  // namespace smartmill::kalman
