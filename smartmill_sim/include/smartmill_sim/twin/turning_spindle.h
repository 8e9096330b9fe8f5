#pragma once

#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// Dependence of the tool's modes on the spindle speed: bearings lose preload stiffness by the centrifugal
/// force of the balls (square of the speed), and a bending mode of the rotor splits into a backward and a
/// forward whirl mode (gyroscopic moment, proportional to the speed).
struct TurningSpindle {
  double reference_speed = 1.0;  ///< [rad/s] > 0
  double softening =
      0.0;  ///< [1] relative loss of modal stiffness at the reference speed; 0 <= softening < 1
  double damping_rise = 0.0;  ///< [1] relative increase of the damping ratio at the reference speed, linear
  double gyroscopic = 0.0;    ///< [1] half the separation of the two whirl modes at the reference speed,
                              ///< relative to the frequency

  /// Modes of an axis at a speed [rad/s]; the first mode splits into two. For an isotropic rotor
  /// m x'' + c x' + k x + g y' = f_x, m y'' + c y' + k y - g x' = f_y the direct FRF is the sum of two real
  /// modes at sqrt(w0^2 + d^2) -+ d with d = g / 2m, gains k^-1 w0^2 / (w (w_b + w_f)), damping ratios
  /// 2 zeta w0 / (w_b + w_f). The cross FRF of the two axes is neglected.
  /// @throws Error on a parameter out of range.
  ModalModel at(double speed, const ModalModel& at_rest) const;
  /// The model with the modes of its tool tip at a speed [rad/s].
  MachineModel at(double speed, const MachineModel& at_rest) const;
};

}  // namespace smartmill::sim
