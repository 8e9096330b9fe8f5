#pragma once

#include <functional>
#include <vector>

#include "smartmill_stability/control/turning_control.h"

namespace smartmill::stability {

/// Single-point turning after Kim: chip thickness a = a0 - y(t) + mu y(t - T), force K a, one mode, y = y_w -
/// y_t the deflection y_w of the machine less the displacement y_t that an actuator gives to the tool (Kim
/// eq. 1..4, 9).
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

/// Least K / K_m at which some speed chatters: 2 (zeta + zeta^2) (Kim eq. 7, Merritt).
double merrittLimit(double damping_ratio);
/// [rad/s] w_m sqrt(1 + 2 zeta), where the real part is least (Kim eq. 6).
double criticalFrequency(double natural_frequency, double damping_ratio);
/// [1/s] of the dominant root of the uncontrolled process; positive: chatter.
double growthRate(const TurningProcess& process);

/// Actuator commands of the classical schemes. Each is called with deflection and tool displacement [m] and
/// returns the tool displacement to make.
using ControlLaw = std::function<double(double deflection, double tool)>;

/// Displacement error (Mitchell and Harrison): the tool follows gain x the relative displacement through a
/// lag of the first order. @param bandwidth [Hz]
ControlLaw displacementErrorControl(double gain, double bandwidth, double rate);

/// Cutting force (Nachtigal): a fixed model of the machine driven by the force, here the chip thickness; no
/// learning.
ControlLaw forceFeedbackControl(const SecondOrder& model, const TurningProcess& process, double rate);

struct TurningRun {
  std::vector<double> time;        ///< [s]
  std::vector<double> motion;      ///< [m] y_w - y_t
  std::vector<double> deflection;  ///< [m] y_w
};

/// Regenerative simulation, exact for chip thickness linear within a step. @param noise_rms [m] on both
/// streams that the law sees
/// @param duration [s] @param rate [Hz] @param law may be empty: no control
TurningRun simulateTurning(const TurningProcess& process, double duration, double rate, double noise_rms,
                           unsigned seed, const ControlLaw& law);

}  // namespace smartmill::stability
