#pragma once

#include <cstddef>
#include <vector>

#include "plant/plate.h"

namespace smartmill::plant {

/// An upright part of a clamped workpiece: a rectangular Euler-Bernoulli beam on the plate.
struct UprightBeam {
  double height = 0.0;     ///< [m]
  double width = 0.0;      ///< [m] across the direction of bending
  double thickness = 0.0;  ///< [m] along it
  double young = 0.0;      ///< [N/m2]
  double density = 0.0;    ///< [kg/m3]
};

/// A dynamometer that carries elastic bodies and is itself on an elastic machine table, along one horizontal
/// direction: beams (workpiece, jaws of the vice) on a rigid plate, the plate on springs against displacement
/// and tilting, the springs on the table, the table on a spring. The sensor measures the force in the spring
/// against displacement.
struct ElasticDynamometer {
  std::vector<UprightBeam> beams;  ///< the force acts on the first one
  double plate_mass = 0.0;         ///< [kg]
  double plate_inertia = 0.0;      ///< [kg m2] against tilting
  double stiffness = 0.0;          ///< [N/m] of the sensor
  double stiffness_tilting = 0.0;  ///< [N m/rad]
  double table_mass = 0.0;         ///< [kg]
  double table_stiffness = 0.0;    ///< [N/m]
  double damping_ratio = 0.0;      ///< [1] of every mode
};

/// All modes of the element model, lowest first, from a force along axis (0, 1 or 2) at a height above the
/// plate [m] on the first beam to the measured force along the same axis. Their static responses add up to 1.
std::vector<SensorMode> modesOf(const ElasticDynamometer& dynamometer, std::size_t axis, double height);

}  // namespace smartmill::plant
