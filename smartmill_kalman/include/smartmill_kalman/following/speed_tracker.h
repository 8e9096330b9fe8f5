#pragma once

#include <cstddef>

#include "smartmill_core/parameters/parameter_table.h"

namespace smartmill::kalman {

/// Estimation of the spindle speed from the force, without a tachometer.
struct SpeedTrackerParameters {
  double speed_std = 0.01;
  double acceleration_std = 0.02;
  double acceleration_memory = 0.25;  ///< [s] correlation time of the acceleration

  double noise_limit = 2.0;  ///< [1] mean square of innovations over that of the noise: more is no noise
  double min_slope_ratio =
      10.0;  ///< [1] mean square of a slope over that by noise, which would bias the speed
  double rise_revolutions = 1.5;  ///< in which the amplitudes settle after a change of the force
  /// [s], [1] A change of the load changes the speed; the standard deviation of the acceleration then decays
  /// within load_decay to load_floor of its initial value, as a spindle's control does.
  double load_decay = 0.2, load_floor = 0.1;
  double max_deviations = 3.0;         ///< [std] of the nominal speed, which limit the estimate
  double max_limit_revolutions = 3.0;  ///< at the limit before the tracker restarts: it is lost
  /// [1] A harmonic is used while one standard deviation of the speed shifts it by less than this share of
  /// the harmonics' spacing, beyond which it is mistaken for its neighbour.
  double max_shift = 0.15;
  double min_harmonics = 8.0;  ///< the lowest ones are always used: without them there is no slope

  void declare(ParameterTable& table) {
    table.number("speed_std", speed_std, "1", Range::positive(),
                 "relative standard deviation of the cutting condition's speed");
    table.number("acceleration_std", acceleration_std, "1/s", Range::positive(),
                 "relative change of speed per second by load, standard deviation");
    table.internal("acceleration_memory", acceleration_memory, "s", Range::positive());
  }
  /// @throws Error naming key and value.
  void validate() const;
};

/// Extended Kalman filter with phase, speed and acceleration of the spindle as states (proposed in Dunwoody
/// section 7.1). The harmonics are states of the axes' HarmonicFilters, which demodulate with the speed given
/// here. When the spindle leads them by a phase e, each sample differs from its prediction by e times the
/// derivative of the predicted force with respect to the angle. All harmonics of all axes contribute to the
/// one estimate of e.
///
///   e' = (speed - speed used) - e / memory,  speed' = acceleration,  acceleration' = white - acceleration /
///   T innovation = slope e + noise
///
/// The second term: the filters absorb a constant phase into their amplitudes within their memory. The noise
/// is that of the sensor, or the recent power of the innovations where that is larger (tool entry).
class SpeedTracker {
 public:
  /// @param speed [rad/s] > 0 nominal @param sample_rate [Hz] @throws Error.
  SpeedTracker(const SpeedTrackerParameters& parameters, double speed, double sample_rate);

  /// One sample later. @param speed_used [rad/s] by the harmonic filters @param memory [s] of them
  void predict(double speed_used, double memory);
  /// One axis' sample. @param innovation [N] @param slope [N/rad] of the expected force over the spindle's
  /// angle @param noise_rms [N] of the sensor
  /// @param slope_noise [N/rad] of the slope without a force
  void update(std::size_t axis, double innovation, double slope, double noise_rms, double slope_noise);
  /// After a change of the force, with which the speed may change.
  void resetCovariance();

  double speed() const { return speed_; }                ///< [rad/s]
  double speedStd() const;                               ///< [rad/s]
  double acceleration() const { return acceleration_; }  ///< [rad/s2]

 private:
  SpeedTrackerParameters parameters_;
  double dt_, nominal_;
  double phase_ = 0.0, speed_, acceleration_ = 0.0;
  double p_[3][3] = {};
  double decay_, drive_;                          // acceleration model [1], [rad2/s4]
  double max_variance_;                           // [rad2/s2] of the speed
  double rise_left_;                              // [s] until the amplitudes have settled
  double at_limit_ = 0.0;                         // [s] at the limit of the speed
  double slope_power_[3] = {0.0, 0.0, 0.0};       // [N2/rad2] mean square of each axis' slope
  double innovation_power_[3] = {0.0, 0.0, 0.0};  // [N2] mean square of each axis' innovations
};

}  // namespace smartmill::kalman
