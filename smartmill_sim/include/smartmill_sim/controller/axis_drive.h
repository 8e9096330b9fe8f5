#pragma once

namespace smartmill::sim {

/// Feed drive of one axis: load of its motor and current per force. The defaults are typical of a small mill:
/// 400 kg on a ball screw of 10 mm lead, a motor of 1.0 N m/A.
struct AxisDrive {
  double mass = 400.0;              ///< [kg] moved mass, inertia of the motor included
  double viscous = 600.0;           ///< [N s/m]
  double coulomb = 150.0;           ///< [N]
  double force_per_ampere = 628.0;  ///< [N/A]
  double rated_current = 12.0;      ///< [A] 100 % of the load meter
  double stribeck = 0.0;            ///< [N] excess of the friction at vanishing speed over coulomb
  double stribeck_velocity = 2e-3;  ///< [m/s] speed at which this excess has fallen to 1/e
  double weight = 0.0;              ///< [N] of the slide, towards the negative end of the axis
  double disturbance = 0.0;  ///< [N] amplitude of a force periodic in the position (revolutions of the screw)
  double disturbance_period = 0.01;  ///< [m]

  /// Friction force against the motion [N]; 0 at rest. @param factor on the friction, for the temperature of
  /// the machine
  double friction(double velocity, double factor = 1.0) const;

  /// Force of the motor [N]. @param cut [N] cutting force on the tool along the axis
  double force(double position, double velocity, double acceleration, double cut,
               double friction_factor = 1.0) const;
};

}  // namespace smartmill::sim
