#pragma once

#include <vector>

#include "smartmill_loadmeter/calibration/friction_law.h"
#include "smartmill_loadmeter/calibration/load_meter.h"

namespace smartmill::loadmeter {

struct Estimate {
  double value = 0.0;
  double std_dev = 0.0;
};

/// Idle voltage V = Kb w^2 + KTcf w (Dunwoody eq. 3.6..3.8).
struct IdleVoltage {
  Estimate kb;              ///< [V s2/rad2]
  Estimate ktcf;            ///< [V s/rad]
  double covariance = 0.0;  ///< of the two

  double at(double speed) const { return (kb.value * speed + ktcf.value) * speed; }  ///< [V]
};

/// Least squares of the voltage, all speeds alike as the thesis has it. The standard deviations are the
/// larger of the residuals' and the rounding's (resolution / sqrt(12) each, eq. 3.12).
/// @throws Error with fewer than two speeds at or above zero_below.
IdleVoltage fitIdleVoltage(const std::vector<AirCut>& air_cuts, double zero_below, double resolution);

/// A cut whose mean torque is known otherwise: a dynamometer, or a standard cut recorded remotely.
struct ReferenceCut {
  double speed = 0.0;       ///< [rad/s]
  double voltage = 0.0;     ///< [V] steady
  double torque = 0.0;      ///< [N m] mean cutting torque
  double torque_std = 0.0;  ///< [N m]
};

/// What the load meter and the spindle's friction are.
struct MachineCalibration {
  IdleVoltage idle;
  Estimate gain;     ///< K [V/W]
  Estimate viscous;  ///< b [N m s/rad]
  Estimate coulomb;  ///< T_cf [N m]
};

/// K from the straight line K w = (V - V_f) / T_c through zero (eq. 3.10, fig. 3.2), then b and T_cf (eq.
/// 3.11). V_f = Kb w^2 + KTcf w: eq. 3.9 of the thesis lacks K before T_cf. Every standard deviation carries
/// the rounding. @throws Error without a reference cut.
MachineCalibration calibrateLoadMeter(const IdleVoltage& idle, const std::vector<ReferenceCut>& cuts,
                                      double zero_below, double resolution);

/// Load meter while the tool leaves the workpiece: steady, then falling (fig. 3.3).
struct ExitFit {
  Estimate bandwidth;   ///< [Hz] first order
  Estimate exit_time;   ///< [s] from the first sample
  double before = 0.0;  ///< [V] in cut
  double after = 0.0;   ///< [V] idle
  double noise = 0.0;   ///< [V] RMS of what is left
};

/// Fits the first-order response to samples at even intervals [s] that begin in steady cut and end idle.
/// @param resolution [V]: rounding that noise does not dither bounds the standard deviations from below.
/// @throws Error when the record holds no fall.
ExitFit fitExit(const std::vector<double>& voltage, double interval, double resolution);

}  // namespace smartmill::loadmeter
