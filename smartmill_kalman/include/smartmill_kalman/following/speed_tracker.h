#pragma once

#include <cstddef>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::kalman {

/// How the spindle's speed is told from the force where there is no tachometer.
struct SpeedTrackerParameters {
  double speed_std = 0.01;
  double acceleration_std = 0.02;
  double acceleration_memory = 0.25;  ///< [s] over which the acceleration changes

  void declare(ParameterTable& table) {
    table.number("speed_std", speed_std, "1", Range::positive(),
                 "share by which the cutting condition's speed may be off");
    table.number("acceleration_std", acceleration_std, "1/s", Range::positive(),
                 "share of the speed that load takes or gives back in a second");
    table.internal("acceleration_memory", acceleration_memory, "s", Range::positive());
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Extended Kalman filter with phase, speed and acceleration of the spindle as states (Dunwoody section 7.1
/// asks for it). The harmonics themselves are the states of the axes' HarmonicFilters, which demodulate with
/// the speed given here; what they cannot know in time is that the spindle runs ahead of them by a phase e:
/// every sample then differs from the expected one by the slope of the expected force over the angle times e.
/// All harmonics of all axes speak about the one e.
///
///   e' = (speed - speed used) - e / memory,  speed' = acceleration,  acceleration' = white - acceleration /
///   T innovation = slope e + noise
///
/// The filters take a lasting phase into their amplitudes within their memory: the second term. Noise is the
/// sensor's, or what the innovations have been lately where that is more (entry of the tool).
class SpeedTracker {
 public:
  /// @param speed [rad/s] > 0 nominal @param sample_rate [Hz] @throws Error.
  SpeedTracker(const SpeedTrackerParameters& parameters, double speed, double sample_rate);

  /// One sample later. @param speed_used [rad/s] by the harmonic filters @param memory [s] of them
  void predict(double speed_used, double memory);
  /// One axis' sample. @param innovation [N] @param slope [N/rad] of the expected force over the spindle's
  /// angle @param noise_rms [N] of the sensor
  /// @param slope_noise [N/rad] of the slope when nothing but noise is measured
  void update(std::size_t axis, double innovation, double slope, double noise_rms, double slope_noise);
  /// The force has changed: the speed may have, too.
  void resetCovariance();

  double speed() const { return speed_; }                ///< [rad/s]
  double speedStd() const;                               ///< [rad/s]
  double acceleration() const { return acceleration_; }  ///< [rad/s2]

 private:
  double dt_, nominal_;
  double phase_ = 0.0, speed_, acceleration_ = 0.0;
  double p_[3][3] = {};
  double decay_, drive_;                // of the acceleration [1], [rad2/s4]
  double most_variance_;                // [rad2/s2] of the speed
  double wait_;                         // [s] until the amplitudes have risen
  double beyond_ = 0.0;                 // [s] at the end of what the speed can be
  double slope_[3] = {0.0, 0.0, 0.0};   // [N2/rad2] mean square of each axis' slope
  double lately_[3] = {0.0, 0.0, 0.0};  // [N2] mean square of each axis' innovations
};

}  // namespace smartmill::kalman
