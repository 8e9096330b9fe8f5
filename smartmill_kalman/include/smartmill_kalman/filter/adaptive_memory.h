#pragma once

#include <cstddef>

namespace smartmill::kalman {

/// Chooses the memory of a filter from its innovations; level 0 is the shortest. A window of samples with
/// larger innovations than in the revolution before (a change of the force) resets the level. A revolution
/// without a decrease of the innovations raises it.
class AdaptiveMemory {
 public:
  /// @param levels >= 1 @param revolution [samples]
  AdaptiveMemory(std::size_t levels, double revolution);

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

 private:
  void checkWindow();
  void checkRevolution();

  std::size_t levels_, level_ = 0, restarts_ = 0;
  std::size_t window_count_ = 0, windows_ = 0, windows_a_revolution_ = 1, dwell_ = 0;
  double window_sum_ = 0.0, revolution_sum_ = 0.0, peak_ = 0.0, last_peak_ = 0.0, last_mean_ = 0.0,
         accepted_mean_ = 0.0;
};

}  // namespace smartmill::kalman
