#pragma once

#include <cstddef>
#include <vector>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// How a filter is laid out; see launch/config/kalman.yaml.
struct HarmonicFilterParameters {
  double bandwidth = 5000.0;          ///< [Hz] harmonics of the spindle frequency up to here; > 0
  int max_harmonics = 60;             ///< 1..200, also kept below 0.45 of the sample rate
  double noise_rms = 1.0;             ///< [N] of one sample; > 0
  double settling_revolutions = 0.3;  ///< [1] time constant of each harmonic's amplitude, in revolutions; > 0
  /// @throws Error naming key and value.
  void validate() const;
};

/// Kalman filter of Dunwoody chapter 5 for one axis at one spindle speed: sensor modes (eq. 5.18..5.23,
/// static gain 1) driven by a force that is a constant and N harmonics of the spindle frequency with slowly
/// wandering amplitudes (eq. 5.28..5.35), discretised exactly, with the stationary gain of the discrete
/// Riccati equation. The process noise follows from the settling time: q = (r dt) / tau^2 for every
/// amplitude, which puts each harmonic's pole near -1/tau where the sensor passes the force unchanged.
///
/// The update costs (2 M + 1)(2 N + 1) + O(M + N) multiplications for M modes and allocates nothing.
class HarmonicFilter {
 public:
  /// @param sensor measured over applied force [1] @param spindle_speed [rad/s] > 0 @param sample_rate [Hz]
  HarmonicFilter(const ModalModel& sensor, double spindle_speed, double sample_rate,
                 const HarmonicFilterParameters& parameters);

  /// Takes one measured sample [N]. @return applied force [N] at this sample, from all samples up to it.
  double step(double measured);

  /// Keeps the state going without a measurement. @return predicted force [N].
  double coast();

  /// At rest, no force.
  void reset();

  double innovation() const { return innovation_; }         ///< [N] of the last step
  double innovationStd() const { return innovation_std_; }  ///< [N] expected by the design
  double spindleSpeed() const { return spindle_speed_; }    ///< [rad/s]
  int harmonics() const { return harmonics_; }

 private:
  double predict();
  double force() const;

  double spindle_speed_;
  std::size_t modes_;
  int harmonics_;
  std::vector<double> mode_transition_;  // 4 a mode, row-major
  std::vector<double> coupling_;         // 2 modes x (2 N + 1), row-major: force states to mode states
  std::vector<double> rotation_;         // cos, sin of each harmonic's step
  std::vector<double> gain_;             // mode states, then force states
  double direct_;
  std::vector<double> state_, next_;  // predicted: mode states, then constant, then (F, G) of each harmonic
  double innovation_ = 0.0;
  double innovation_std_ = 0.0;
};

}  // namespace smartmill::kalman
