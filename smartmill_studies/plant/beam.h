#pragma once

#include <vector>

namespace smartmill::plant {

/// A mode of a structure at one point (drive point).
struct PointMode {
  double frequency = 0.0;      ///< [Hz] undamped
  double damping_ratio = 0.0;  ///< [1]
  double compliance = 0.0;     ///< [m/N] share of the static compliance at that point
};

/// A mode with response and force at different points.
struct CrossMode {
  double frequency = 0.0;  ///< [Hz] undamped
  double gain = 0.0;       ///< [m/N] share of the static compliance between both points
};

/// An end mill as a round Euler-Bernoulli beam in a spindle, which is a rigid body on a lateral and a tilting
/// spring.
struct ToolInSpindle {
  double stickout = 0.0;        ///< [m]
  double shank_diameter = 0.0;  ///< [m]
  double fluted_length = 0.0;  ///< [m] from the tip; there the section is flute_ratio of the shank's diameter
  double flute_ratio = 0.8;    ///< [1] effective diameter of the fluted part over the shank's
  double young = 0.0;          ///< [N/m2]
  double density = 0.0;        ///< [kg/m3]
  double spindle_mass = 0.0;   ///< [kg]
  double spindle_inertia = 0.0;    ///< [kg m2] against tilting
  double stiffness_across = 0.0;   ///< [N/m]
  double stiffness_tilting = 0.0;  ///< [N m/rad]
  double damping_ratio = 0.0;      ///< [1] of every mode
  double mass_behind = 0.0;        ///< [m] distance of the spindle's centre of mass behind the tool's seat
  double spring_behind = 0.0;      ///< [m] distance of the lateral spring behind the tool's seat
};

/// Modes at the tool's tip below a frequency [Hz], lowest first; twelve elements along the stick-out.
std::vector<PointMode> tipModes(const ToolInSpindle& tool, double below);
/// The same with force and response at heights above the tip [m].
std::vector<CrossMode> crossModes(const ToolInSpindle& tool, double struck, double read, double below);

}  // namespace smartmill::plant
