#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "smartmill_kalman/filter/harmonic_filter.h"
#include "smartmill_kalman/following/speed_tracker.h"

namespace smartmill::kalman {

/// Spindle speed from the innovations of the three axes' harmonic filters: SpeedTracker with the slopes and
/// noise of these filters.
class HarmonicSpeedTracker {
 public:
  /// @param speed [rad/s] nominal @param sample_rate [Hz]
  HarmonicSpeedTracker(const SpeedTrackerParameters& tracker, const HarmonicFilterParameters& filter,
                       double speed, double sample_rate);

  /// Before the filters' step of a sample. @param speed [rad/s] that the filters use
  void prepare(const std::vector<HarmonicFilter>& filters, double speed);
  /// After the step. @param noise_rms [N] of each axis
  void update(const std::vector<HarmonicFilter>& filters, const std::array<double, 3>& noise_rms);

  double speed() const { return tracker_.speed(); }        ///< [rad/s]
  double speedStd() const { return tracker_.speedStd(); }  ///< [rad/s]

 private:
  SpeedTrackerParameters limits_;
  SpeedTracker tracker_;
  HarmonicFilterParameters filter_;
  double sample_rate_;
  double speed_used_;              // [rad/s]
  double memory_ = 0.0;            // [s] of the filters
  double slope_gain_ = 0.0;        // [1] noise of a slope over that of a harmonic's amplitude
  std::array<double, 3> slope_{};  // [N/rad]
  std::size_t restarts_ = 0;       // of all filters
};

}  // namespace smartmill::kalman
