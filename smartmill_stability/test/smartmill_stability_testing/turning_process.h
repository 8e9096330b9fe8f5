#pragma once

#include <functional>
#include <vector>

#include "smartmill_stability/control/turning_control.h"

namespace smartmill::stability {

/// Single-point turning (Kim eq. 1..4, 9): chip thickness a = a0 - y(t) + mu y(t - T), force K a, one mode, y
/// = y_w - y_t: deflection y_w of the machine minus displacement y_t of the tool by an actuator.
struct TurningProcess {
  double stiffness_ratio = 0.1;      ///< [1] K / K_m, cutting over machine stiffness, > 0
  double damping_ratio = 0.02;       ///< [1] 0 < value < 1
  double natural_frequency = 350.0;  ///< [rad/s] > 0
  double overlap = 1.0;              ///< [1] mu, 0..1
  double period = 0.1;               ///< [s] T of a revolution, > 0
  double chip = 1e-4;                ///< [m] a0, nominal chip thickness
  /// @throws Error naming the quantity.
  void validate() const;
};

/// [1] Critical K / K_m: smallest value with chatter at some speed, 2 (zeta + zeta^2) (Kim eq. 7, Merritt).
double merrittLimit(double damping_ratio);
/// [rad/s] w_m sqrt(1 + 2 zeta), frequency of the smallest real part (Kim eq. 6).
double criticalFrequency(double natural_frequency, double damping_ratio);
/// [1/s] Real part of the dominant root of the uncontrolled process; positive: chatter.
double growthRate(const TurningProcess& process);

/// Actuator command of a classical scheme: commanded tool displacement [m] from deflection and tool
/// displacement [m].
using ControlLaw = std::function<double(double deflection, double tool)>;

/// Displacement error feedback (Mitchell and Harrison): the tool follows gain x relative displacement through
/// a first-order lag. @param bandwidth [Hz] @param rate [Hz]
ControlLaw displacementErrorControl(double gain, double bandwidth, double rate);

/// Cutting force feedback (Nachtigal): a fixed model of the machine driven by the force, here the chip
/// thickness.
ControlLaw forceFeedbackControl(const SecondOrder& model, const TurningProcess& process, double rate);

struct TurningRun {
  std::vector<double> time;        ///< [s]
  std::vector<double> motion;      ///< [m] y_w - y_t
  std::vector<double> deflection;  ///< [m] y_w
};

/// Regenerative simulation, exact for a chip thickness that is linear within a step.
/// @param duration [s] @param rate [Hz] @param noise_rms [m] on both inputs of the law @param law empty: no
/// control
TurningRun simulateTurning(const TurningProcess& process, double duration, double rate, double noise_rms,
                           unsigned seed, const ControlLaw& law);

}  // namespace smartmill::stability
