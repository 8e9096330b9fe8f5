#pragma once

#include <optional>
#include <vector>

#include "smartmill_core/modal/modal_model.h"

namespace smartmill::kalman {

/// Gains of one filter, in the coordinates of Dunwoody eq. 5.37: mode states (two a mode, StateSpace form),
/// then the constant, then (F, G) of each harmonic.
struct HarmonicGain {
  std::vector<double> filter;  ///< [state/N] P c' / (c P c' + r)
  std::vector<double>
      smoothing;          ///< [state N] P d', d the force of a state, P the stationary prediction covariance
  double variance = 0.0;  ///< [N2] of the innovation
};

/// Parameters of a stationary gain.
struct HarmonicDesign {
  ModalModel sensor;             ///< measured over applied force [1]
  double spindle_speed = 0.0;    ///< [rad/s]
  double sample_rate = 0.0;      ///< [Hz]
  double noise_rms = 0.0;        ///< [N] of one sample; the gain does not depend on it
  std::vector<double> settling;  ///< [s] of each harmonic, 0 .. N
};

/// Number of harmonics of the spindle up to `top` [Hz], at least 1. @param revolution [s]
int harmonicCount(double top, double revolution, int most);

/// Time constant of a harmonic at f [Hz] for a required `settling`. One with a low transmissibility is slow
/// already: min(1, 2 |H|) settling, at least `quickest`, so that a long memory does not slow it further.
double harmonicSettling(const ModalModel& sensor, double f, double settling, double quickest);

/// Stationary gain of the Kalman filter of Dunwoody eq. 5.37, exact in time (Van Loan's integrals for the
/// noise). Process noise q = (r dt) / tau^2 for every amplitude puts each harmonic's pole near -|H| / tau, H
/// the sensor's response to it. Uses spectralGain(), or riccatiGain() when that fails; both give the same
/// numbers.
HarmonicGain designHarmonicGain(const HarmonicDesign& design);

/// The same with one time constant and harmonicSettling() of it.
/// @param spindle_speed [rad/s] @param sample_rate [Hz] @param settling, quickest [s]
HarmonicGain designHarmonicGain(const ModalModel& sensor, double spindle_speed, double sample_rate,
                                int harmonics, double noise_rms, double settling, double quickest);

/// By spectral factorisation in decoupled coordinates. The spectrum of the measurement,
/// r + |force through the sensor|^2, is a sum of partial fractions of known poles; its zeros inside the unit
/// circle are the filter's poles, found together (Aberth, Math. Comp. 27 (1973) 339); the gain is the
/// residues of zeros over poles, the covariance follows from it in closed form: the square of the number of
/// states instead of its cube for the Riccati equation.
/// @return nothing when the product of the factors differs from the spectrum by more than 1e-9
std::optional<HarmonicGain> spectralGain(const HarmonicDesign& design);

/// By the discrete Riccati equation of all states together. @throws Error when it has no solution.
HarmonicGain riccatiGain(const HarmonicDesign& design);

}  // namespace smartmill::kalman
