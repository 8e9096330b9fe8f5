#pragma once

namespace smartmill::sim {

/// An axis' drive: what its motor has to carry and how much current that takes. Typical of a machine of this
/// size: 400 kg on a screw of 10 mm lead, a motor of 1.0 N m/A.
struct AxisDrive {
  double mass = 400.0;               ///< [kg] moved, the motor's inertia included
  double viscous = 600.0;            ///< [N s/m]
  double coulomb = 150.0;            ///< [N]
  double force_per_ampere = 628.0;   ///< [N/A]
  double rated_current = 12.0;       ///< [A] 100 % of the load meter
  double stribeck = 0.0;             ///< [N] what friction at the least speed has above coulomb
  double stribeck_velocity = 2e-3;   ///< [m/s] over which that falls to 1/e
  double weight = 0.0;               ///< [N] of the slide, towards the negative end of the axis
  double disturbance = 0.0;          ///< [N] amplitude, repeating with the position (the screw's turns)
  double disturbance_period = 0.01;  ///< [m]

  /// Friction against a motion [N]; 0 at rest. @param factor of a warm or cold machine
  double friction(double velocity, double factor = 1.0) const;

  /// Force that the motor makes [N]. @param cut [N] on the tool, which the drive holds against
  double force(double position, double velocity, double acceleration, double cut,
               double friction_factor = 1.0) const;
};

}  // namespace smartmill::sim
