#pragma once

#include "smartmill_core/model/machine_model.h"

namespace smartmill::sim {

/// How the tool's modes change with the speed of the spindle that holds it: bearings lose preload stiffness
/// to the balls' centrifugal force, with the square of the speed, and a rotor's bending mode parts into a
/// backward and a forward whirl (its gyroscopic moment, in proportion to the speed).
struct TurningSpindle {
  double reference_speed = 1.0;  ///< [rad/s] > 0
  double softening = 0.0;        ///< [1] of the modes' stiffness, lost at the reference speed; 0 <= . < 1
  double damping_rise = 0.0;     ///< [1] of the damping ratio, gained at the reference speed, linear
  double gyroscopic =
      0.0;  ///< [1] half the distance of the two whirls at the reference speed, of the frequency

  /// Modes of an axis at a speed [rad/s]; the first mode parts into two. Of an isotropic rotor
  /// m x'' + c x' + k x + g y' = f_x, m y'' + c y' + k y - g x' = f_y the direct FRF is the sum of two real
  /// modes at sqrt(w0^2 + d^2) -+ d with d = g / 2m, gains k^-1 w0^2 / (w (w_b + w_f)), damping ratios
  /// 2 zeta w0 / (w_b + w_f). The cross FRF of the two axes is left out.
  /// @throws Error on a parameter out of its range.
  ModalModel at(double speed, const ModalModel& standing) const;
  /// The model with its tool's modes at a speed [rad/s].
  MachineModel at(double speed, const MachineModel& standing) const;
};

}  // namespace smartmill::sim
